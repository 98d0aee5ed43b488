// Purpose: expect an mpc::Error with its code and a part of its message.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "mpc/core/error.h"

// EXPECT_MPC_ERROR(Load("missing.json"), kFileNotFound, "missing.json");
#define EXPECT_MPC_ERROR(statement, expected_code, message_part)                   \
  do {                                                                             \
    try {                                                                          \
      statement;                                                                   \
      ADD_FAILURE() << #statement " threw nothing";                                \
    } catch (const ::mpc::Error& error) {                                          \
      EXPECT_STREQ(::mpc::ErrorCodeName(error.code()),                             \
                   ::mpc::ErrorCodeName(::mpc::ErrorCode::expected_code));         \
      EXPECT_THAT(error.what(), ::testing::HasSubstr(message_part)) << #statement; \
    }                                                                              \
  } while (false)
