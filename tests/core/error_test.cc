#include "mpc/core/error.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace mpc {
namespace {

TEST(ErrorTest, CarriesCodeAndMessage) {
  const Error error(ErrorCode::kBadFile, "a.json, line 3: found x, expected y");
  EXPECT_EQ(error.code(), ErrorCode::kBadFile);
  EXPECT_STREQ(error.what(), "a.json, line 3: found x, expected y");
}

TEST(ErrorTest, EveryCodeHasItsOwnName) {
  std::set<std::string> names;
  for (int code = 0; code <= static_cast<int>(ErrorCode::kCancelled); ++code) {
    names.insert(ErrorCodeName(static_cast<ErrorCode>(code)));
  }
  EXPECT_EQ(names.size(), 7u);
  EXPECT_FALSE(names.contains("unknown"));
}

}  // namespace
}  // namespace mpc
