// runGuarded: a function's result from a process of its own.
//
// The process is a copy of this one, so the function sees all that is there and changes none of it. If it crashes,
// hangs or takes too much memory, that is an error here. It has none of this process's descriptors but that of standard
// error, and ends with this one. Threading: any thread; the function must not wait for other
// threads, which the copy does not have.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include <rtsg/core/diagnostic.h>

namespace rtsg::detail {

struct GuardLimits {
    std::uint64_t bytes = 0;  // of the result, and of memory beyond what this process has
    unsigned seconds = 60;    // of processor time; four times that by the clock
};

/// `make` gives the result, or false and why not. Errors: that; or what ended the process.
Result<std::string> runGuarded(const std::function<bool(std::string& result)>& make, const GuardLimits& limits);

}  // namespace rtsg::detail
