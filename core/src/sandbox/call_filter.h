// The system calls that a worker keeps.
//
// Threading: the calling thread, which must be the only one. Source: Linux, seccomp(2) and its filters of BPF.
#pragma once

namespace rtsg::sandbox {

/// Whether the kernel has such filters.
bool hasCallFilter();
/// From here on all other calls fail as not permitted. False: the kernel does not let it.
bool keepFewCalls();

}  // namespace rtsg::sandbox
