// Loops on all cores, for pictures and sound. Threading: any thread may run one, also from within another.
#pragma once

#include <cstddef>
#include <functional>

namespace rtsg {

/// How many threads parallelFor() uses here: the machine's cores, or what withThreads() allows.
unsigned availableThreads();

/// Runs body(0) … body(count - 1), in no order, on the cores there are, and returns when all have ended. What the
/// caller wrote before is seen by every call, and what the calls wrote is seen by the caller. An exception of a call
/// ends the others early and comes out of here. The body may be called by several threads at once.
///
///     std::vector<double> roots(1000);
///     parallelFor(roots.size(), [&](std::size_t i) { roots[i] = std::sqrt(static_cast<double>(i)); });
void parallelFor(std::size_t count, const std::function<void(std::size_t)>& body);

/// Runs `work` so that loops within it use at most `threads` threads; 0, or more than there are, means all there are.
void withThreads(unsigned threads, const std::function<void()>& work);

/// Runs `work` so that a thread that waits for loops within it takes up nothing else meanwhile: for loops under a lock
/// that what it would take up may want too.
void apart(const std::function<void()>& work);

}  // namespace rtsg
