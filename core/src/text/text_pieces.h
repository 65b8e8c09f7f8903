// Reads a long text by several threads, which take pieces of it, the oldest first.
//
// Invariant: reports come in the order of the text, from the thread that asks. Threading: all calls are that thread's;
// the others see the text of pieces, which nobody changes, and the piece's own data.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "splitting.h"

namespace rtsg::detail {

struct TextPiece {
    const char* begin;
    const char* end;
    const char* stop = begin;  // it has been gone through up to here
    void* numbers = nullptr;   // of NumberPieces: room for one every two bytes, and for a run's look
    std::size_t count = 0;
    enum class State : std::uint8_t { waits, atWork, done } state = State::waits;
};

/// Threads that read pieces, the oldest first.
class PieceReaders {
  public:
    /// Starts as many threads beside the reader's own as the system lets it.
    PieceReaders(unsigned threads, std::function<void(TextPiece&)> read);
    /// Waits for threads that are at work.
    ~PieceReaders();
    PieceReaders(const PieceReaders&) = delete;
    PieceReaders& operator=(const PieceReaders&) = delete;

    void add(TextPiece& piece);
    /// Waits until the piece is done; reads pieces meanwhile.
    void finish(TextPiece& piece);
    /// Nobody is interested in the piece; afterwards nobody looks at it.
    void drop(TextPiece& piece);

  private:
    void work();
    TextPiece* nextLocked();

    const std::function<void(TextPiece&)> read_;
    std::mutex mutex_;
    std::condition_variable forThreads_, forReader_;
    std::deque<TextPiece*> waiting_;
    bool ended_ = false;
    std::vector<std::jthread> threads_;
};

/// Looks ahead for the place where something is out of the ordinary.
class PieceWalk {
  public:
    /// Finds where the piece that begins at `begin` ends, at `most` or before; returns `begin` itself if that cannot be
    /// told.
    using Cut = const char* (*)(const char* begin, const char* maximum);
    /// `look` moves a piece's stop to its end, or to where the ordinary ends.
    PieceWalk(const char* from, const Splitting& splitting, Cut cut, std::function<void(TextPiece&)> look);
    ~PieceWalk();
    PieceWalk(const PieceWalk&) = delete;
    PieceWalk& operator=(const PieceWalk&) = delete;

    /// Cuts as many pieces as there may be from the text up to `end`. True if more text would give another.
    bool add(const char* end);
    /// Moves `p` to where the oldest piece stops. False if there is none, or if that is not its end.
    bool next(const char*& p);

  private:
    const std::size_t size_, maximum_;
    const Cut cut_;
    const char* next_;  // where the next piece begins
    bool ended_ = false;
    std::deque<TextPiece> pieces_;
    PieceReaders readers_;
};

}  // namespace rtsg::detail
