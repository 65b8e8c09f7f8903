// What the programs of one context hold: objects on the engine's heap, and what hangs from them outside of it (the
// contents of arrays and strings, which the engine's own limits do not count).
//
// Invariant: bytes() is never less than what is held by reachable objects as of the last update of each program; it may
// count rubbish that is not collected yet, so whoever finds too much collects first. Threading: the context's thread.
#pragma once

#include <vector>

#include "values.h"

namespace rtsg::script {

class Memory;

/// One program's share; the program's global object is the one of the current realm when this is made.
class Holding {
  public:
    Holding(JSContext* cx, Memory& memory);
    ~Holding();
    Holding(const Holding&) = delete;
    Holding& operator=(const Holding&) = delete;
    /// Asks the engine anew.
    void update();

  private:
    friend class Memory;
    JSContext* cx_;
    Memory& memory_;
    JS::PersistentRootedObject global_, gauge_;
    std::size_t bytes_ = 0;
};

class Memory {
  public:
    /// All programs together, with `changed` asked anew (it may be null).
    std::size_t bytes(JSContext* cx, Holding* changed);
    /// The same after a collection, all asked anew.
    std::size_t bytesCollected(JSContext* cx);

  private:
    friend class Holding;
    std::vector<Holding*> holdings_;
    std::size_t outside_ = 0;  // sum over holdings
};

}  // namespace rtsg::script
