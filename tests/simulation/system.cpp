// The calls that the linker has wrapped, and what they find in place of the kernel.
#include "system.h"

#include <cerrno>
#include <cstdlib>
#include <new>
#include <string>

#include <sys/eventfd.h>
#include <sys/stat.h>
#include <unistd.h>

#include "support/own_heap.h"

namespace rtsg::simulation {

namespace {

System* current = nullptr;

}  // namespace

System* System::installed() {
    return current;
}

System::Installed::Installed(System& system) {
    current = &system;
}
System::Installed::~Installed() {
    current = nullptr;
}

int System::add(Readable* readable) {
    if (free_.empty()) {
        entries_.push_back({readable, 0});
        return kFirstDescriptor + static_cast<int>(entries_.size()) - 1;
    }
    const int index = free_.back();
    free_.pop_back();
    entries_[static_cast<std::size_t>(index)] = {readable, 0};
    return kFirstDescriptor + index;
}

int System::addEvent(std::uint64_t count) {
    const int descriptor = add(nullptr);
    *event(descriptor) = count;
    return descriptor;
}

void System::remove(int descriptor) {
    entries_[static_cast<std::size_t>(descriptor - kFirstDescriptor)] = {};
    free_.push_back(descriptor - kFirstDescriptor);
}

bool System::isReadable(int descriptor) const {
    if (descriptor < kFirstDescriptor) return false;
    const Entry& entry = entries_[static_cast<std::size_t>(descriptor - kFirstDescriptor)];
    return entry.readable ? entry.readable->isReadable() : entry.count > 0;
}

std::uint64_t* System::event(int descriptor) {
    return descriptor < kFirstDescriptor ? nullptr
                                         : &entries_[static_cast<std::size_t>(descriptor - kFirstDescriptor)].count;
}

}  // namespace rtsg::simulation

using rtsg::simulation::System;

// The names are the linker's.
// NOLINTBEGIN(bugprone-reserved-identifier,readability-identifier-naming)
extern "C" {
int __real_eventfd(unsigned count, int flags);
int __real_eventfd_write(int descriptor, eventfd_t value);
int __real_eventfd_read(int descriptor, eventfd_t* value);
ssize_t __real_read(int descriptor, void* bytes, std::size_t size);
ssize_t __real_write(int descriptor, const void* bytes, std::size_t size);
int __real_close(int descriptor);
int __real_ftruncate(int descriptor, off_t size);
int __real_fdatasync(int descriptor);
int __real_fallocate(int descriptor, int mode, off_t offset, off_t size);
int __real_rename(const char* from, const char* to);
int __real_unlink(const char* file);
int __real_link(const char* from, const char* to);
int __real_renameat2(int fromFolder, const char* from, int toFolder, const char* to, unsigned flags);
unsigned __real__ZNSt13random_device9_M_getvalEv(void* device);
void __real__ZNSt13random_device7_M_initERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEE(
    void* device, const std::string& token);
void __real__ZNSt13random_device7_M_finiEv(void* device);

int __wrap_eventfd(unsigned count, int flags) {
    System* system = System::installed();
    return system ? system->addEvent(count) : __real_eventfd(count, flags);
}

int __wrap_eventfd_write(int descriptor, eventfd_t value) {
    System* system = System::installed();
    std::uint64_t* event = system ? system->event(descriptor) : nullptr;
    if (!event) return __real_eventfd_write(descriptor, value);
    *event += value;
    return 0;
}

int __wrap_eventfd_read(int descriptor, eventfd_t* value) {
    System* system = System::installed();
    std::uint64_t* event = system ? system->event(descriptor) : nullptr;
    if (!event) return __real_eventfd_read(descriptor, value);
    *value = *event;
    *event = 0;
    if (*value > 0) return 0;
    errno = EAGAIN;
    return -1;
}

ssize_t __wrap_read(int descriptor, void* bytes, std::size_t size) {
    System* system = System::installed();
    if (!system || !system->event(descriptor)) return __real_read(descriptor, bytes, size);
    if (size < sizeof(eventfd_t)) return errno = EINVAL, -1;
    return __wrap_eventfd_read(descriptor, static_cast<eventfd_t*>(bytes)) == 0 ? ssize_t{sizeof(eventfd_t)} : -1;
}

/// In a session only logs are written.
ssize_t __wrap_write(int descriptor, const void* bytes, std::size_t size) {
    System* system = System::installed();
    if (!system || descriptor <= STDERR_FILENO) return __real_write(descriptor, bytes, size);
    if (system->tearsNextWrite) {
        system->tearsNextWrite = false;
        ++system->failedCalls;
        system->isDead = true;
        if (size > 1) (void)!__real_write(descriptor, bytes, system->random.below(static_cast<std::uint32_t>(size)));
    }
    if (system->isDead) return errno = EIO, -1;
    if (system->isFull) {
        ++system->failedCalls;
        // What still fits is written before the disk says that it is full.
        if (size > 1 && system->random.chance(500))
            return __real_write(descriptor, bytes, 1 + system->random.below(static_cast<std::uint32_t>(size) - 1));
        errno = ENOSPC;
        return -1;
    }
    // A write may be cut short at any time.
    if (size > 1 && system->random.chance(20)) size = 1 + system->random.below(static_cast<std::uint32_t>(size) - 1);
    const ssize_t done = __real_write(descriptor, bytes, size);
    if (done > 0) system->written += static_cast<std::uint64_t>(done);
    return done;
}

int __wrap_close(int descriptor) {
    System* system = System::installed();
    if (!system || !system->event(descriptor)) return __real_close(descriptor);
    system->remove(descriptor);
    return 0;
}

int __wrap_ftruncate(int descriptor, off_t size) {
    System* system = System::installed();
    if (system) {
        if (system->isDead) return errno = EIO, -1;
        struct stat status{};
        if (::fstat(descriptor, &status) == 0)
            if (const auto file = system->flushed.find(status.st_ino);
                file != system->flushed.end() && file->second > size)
                file->second = size;
    }
    return __real_ftruncate(descriptor, size);
}

int __wrap_fdatasync(int descriptor) {
    System* system = System::installed();
    if (!system) return __real_fdatasync(descriptor);
    if (system->failsToFlush || system->isDead) {
        ++system->failedCalls;
        errno = EIO;
        return -1;
    }
    struct stat status{};
    if (::fstat(descriptor, &status) == 0) system->flushed[status.st_ino] = status.st_size;
    return 0;
}

int __wrap_fallocate(int descriptor, int mode, off_t offset, off_t size) {
    System* system = System::installed();
    if (!system || !system->isFull) return __real_fallocate(descriptor, mode, offset, size);
    ++system->failedCalls;
    errno = ENOSPC;
    return -1;
}

int __wrap_rename(const char* from, const char* to) {
    System* system = System::installed();
    if (!system || (!system->isDead && (!system->isFull || !system->random.chance(500))))
        return __real_rename(from, to);
    ++system->failedCalls;
    errno = ENOSPC;
    return -1;
}

int __wrap_unlink(const char* file) {
    System* system = System::installed();
    return system && system->isDead ? 0 : __real_unlink(file);
}

int __wrap_link(const char* from, const char* to) {
    System* system = System::installed();
    return system && system->isDead ? (errno = EIO, -1) : __real_link(from, to);
}
int __wrap_renameat2(int fromFolder, const char* from, int toFolder, const char* to, unsigned flags) {
    System* system = System::installed();
    if (system && system->isDead) return errno = EIO, -1;
    return __real_renameat2(fromFolder, from, toFolder, to, flags);
}

unsigned __wrap__ZNSt13random_device9_M_getvalEv(void* device) {
    System* system = System::installed();
    return system ? static_cast<unsigned>(system->random.next()) : __real__ZNSt13random_device9_M_getvalEv(device);
}
void __wrap__ZNSt13random_device7_M_initERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEE(
    void* device, const std::string& token) {
    if (!System::installed())
        __real__ZNSt13random_device7_M_initERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEE(device, token);
}
void __wrap__ZNSt13random_device7_M_finiEv(void* device) {
    if (!System::installed()) __real__ZNSt13random_device7_M_finiEv(device);
}
}
// NOLINTEND(bugprone-reserved-identifier,readability-identifier-naming)

#if RTSG_HEAP_IS_OURS
namespace {

bool refuses() {
    System* system = System::installed();
    return system && system->untilNoMemory > 0 && --system->untilNoMemory == 0;
}

}  // namespace

#pragma GCC diagnostic ignored "-Wmismatched-new-delete"  // all of them are malloc's and free's
void* operator new(std::size_t size) {
    if (!refuses())
        if (void* memory = std::malloc(size ? size : 1)) return memory;
    throw std::bad_alloc();
}
void operator delete(void* memory) noexcept {
    std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept {
    std::free(memory);
}
#endif
