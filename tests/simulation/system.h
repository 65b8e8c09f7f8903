// System: what sessions that are simulated get in place of the kernel: event descriptors, random numbers, and a disk
// that fails. The linker wraps the calls (CMakeLists.txt), so that the libraries are those that ship.
//
// Invariant: while no Installed lives, calls go to the kernel. Event descriptors are numbers that no kernel gives.
// Files are real ones; the disk's faults are those that the kernel could report, or that a loss of power could leave.
// Threading: one thread.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include <sys/types.h>

#include "random.h"

namespace rtsg::simulation {

/// Something that a process may wait at.
class Readable {
  public:
    virtual bool isReadable() = 0;

  protected:
    ~Readable() = default;
};

class System {
  public:
    static constexpr int kFirstDescriptor = 1 << 24;

    explicit System(std::uint64_t seed) : random(seed, 2) {}

    int add(Readable* readable);
    int addEvent(std::uint64_t count);
    void remove(int descriptor);
    bool isReadable(int descriptor) const;
    std::uint64_t* event(int descriptor);

    // ---- the disk ------------------------------------------------------------------------------------------
    bool isFull = false, failsToFlush = false;
    bool tearsNextWrite = false;
    /// The process that writes was killed: nothing more reaches the disk. A torn write does this.
    bool isDead = false;
    std::uint64_t written = 0, failedCalls = 0;
    /// Bytes of each file, by inode, that a loss of power leaves.
    std::map<ino_t, off_t> flushed;

    // ---- memory --------------------------------------------------------------------------------------------
    /// While not 0, counts down with each allocation; the one at which it becomes 0 fails.
    std::uint64_t untilNoMemory = 0;

    Random random;

    static System* installed();

    /// While it lives, the libraries use this system.
    class Installed {
      public:
        explicit Installed(System& system);
        ~Installed();
        Installed(const Installed&) = delete;
        Installed& operator=(const Installed&) = delete;
    };

  private:
    struct Entry {
        Readable* readable = nullptr;
        std::uint64_t count = 0;
    };
    std::vector<Entry> entries_;
    std::vector<int> free_;
};

}  // namespace rtsg::simulation
