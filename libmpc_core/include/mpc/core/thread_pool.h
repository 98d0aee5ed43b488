// Purpose: run independent frames side by side. Results never depend on the number of threads:
// the function writes only to the place its index owns.
#pragma once

#include <functional>

namespace mpc {

// Number of threads to use for `requested`: itself when positive, else the machine's cores.
int ResolveNumThreads(int requested);

// Calls fn(i) for every i in [0, n) on up to ResolveNumThreads(num_threads) threads and returns when
// all are done.
// The first exception (of the lowest index that threw) is rethrown after all threads stopped; later
// indices may then be skipped. One thread is the calling one.
void ParallelFor(int n, int num_threads, const std::function<void(int)>& fn);

}  // namespace mpc
