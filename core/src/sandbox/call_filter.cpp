// Makes the filter of system calls, and installs it.
#include "call_filter.h"

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <vector>

#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/futex.h>
#include <linux/seccomp.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>

namespace rtsg::sandbox {

namespace {

#if defined(__x86_64__)
#define RTSG_CALLS AUDIT_ARCH_X86_64
#elif defined(__aarch64__)
#define RTSG_CALLS AUDIT_ARCH_AARCH64
#endif

#ifdef RTSG_CALLS

/// Packets over the one socket, memory, the time, the end. Threads are not among them, nor files.
constexpr std::uint32_t kKept[] = {SYS_recvfrom, SYS_sendmsg,       SYS_munmap,       SYS_mremap, SYS_brk,
                                   SYS_madvise,  SYS_clock_gettime, SYS_rt_sigreturn, SYS_exit,   SYS_exit_group};
/// These as well, unless the memory can be executed: the third argument says.
constexpr std::uint32_t kKeptForData[] = {SYS_mmap, SYS_mprotect};

void load(std::vector<sock_filter>& filter, std::size_t offset) {
    filter.push_back(BPF_STMT(BPF_LD | BPF_W | BPF_ABS, static_cast<std::uint32_t>(offset)));
}
void end(std::vector<sock_filter>& filter, std::uint32_t result) {
    filter.push_back(BPF_STMT(BPF_RET | BPF_K, result));
}

std::vector<sock_filter> callFilter() {
    constexpr std::uint32_t kRefused = SECCOMP_RET_ERRNO | EPERM;
    std::vector<sock_filter> filter;
    load(filter, offsetof(seccomp_data, arch));
    filter.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, RTSG_CALLS, 1, 0));
    end(filter, SECCOMP_RET_KILL_PROCESS);
    load(filter, offsetof(seccomp_data, nr));
    for (const std::uint32_t call : kKept) {
        filter.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, call, 0, 1));
        end(filter, SECCOMP_RET_ALLOW);
    }
    for (const std::uint32_t call : kKeptForData) {
        filter.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, call, 0, 4));
        // Its lower half on machines that are little-endian, as both are.
        load(filter, offsetof(seccomp_data, args) + 2 * sizeof(std::uint64_t));
        filter.push_back(BPF_JUMP(BPF_JMP | BPF_JSET | BPF_K, PROT_EXEC, 1, 0));
        end(filter, SECCOMP_RET_ALLOW);
        end(filter, kRefused);
    }
    // pthread_once(), which exceptions begin with, wakes others though there are none, and ends the process if it may
    // not.
    filter.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_futex, 0, 3));
    load(filter, offsetof(seccomp_data, args) + sizeof(std::uint64_t));
    filter.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, FUTEX_WAKE_PRIVATE, 0, 1));
    end(filter, SECCOMP_RET_ALLOW);
    end(filter, kRefused);
    return filter;
}

#endif

}  // namespace

bool hasCallFilter() {
#ifdef RTSG_CALLS
    // It looks for the filter's address if it knows filters at all.
    return ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, nullptr, 0, 0) != 0 && errno == EFAULT;
#else
    return false;
#endif
}

bool keepFewCalls() {
#ifdef RTSG_CALLS
    std::vector<sock_filter> filter = callFilter();
    const sock_fprog program{static_cast<unsigned short>(filter.size()), filter.data()};
    return ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
           ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program, 0, 0) == 0;
#else
    return false;
#endif
}

}  // namespace rtsg::sandbox
