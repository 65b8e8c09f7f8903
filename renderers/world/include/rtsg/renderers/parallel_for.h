// Loops on all cores, for pictures and sound. Threading: any thread may run one, also from within another.
#pragma once

#include <cstddef>
#include <functional>

namespace rtsg {

/// The number of threads that parallelFor() uses: the machine's cores, or what withThreads() allows.
unsigned availableThreads();

/// Runs body(0) … body(count - 1), in no order, on the available cores, and returns when all have ended. Every call
/// sees what the caller wrote before, and the caller sees what the calls wrote. An exception in a call ends the others
/// early and is thrown from here. Several threads may call the body at once.
///
///     std::vector<double> roots(1000);
///     parallelFor(roots.size(), [&](std::size_t i) { roots[i] = std::sqrt(static_cast<double>(i)); });
void parallelFor(std::size_t count, const std::function<void(std::size_t)>& body);

/// Runs `work` so that loops within it use at most `threads` threads; 0, or more than there are, means all.
void withThreads(unsigned threads, const std::function<void()>& work);

/// Runs `work` so that a thread that waits for a loop within it runs no other loop's calls meanwhile. Use it for loops
/// that run under a lock, since such a call might want the same lock.
void apart(const std::function<void()>& work);

}  // namespace rtsg
