// Text that a writer holds back until the text before it is known: in pieces, which are joined while they are short,
// and in an unnamed file if there are many.
//
// Invariant: of settled text, the longest list and 16 MiB beside it stay in memory, unless no such file can be had.
// Pieces of one rope keep their order. Threading: one thread a writer.
#pragma once

#include <cstdint>
#include <functional>
#include <list>
#include <string>
#include <string_view>

#include <rtsg/core/value.h>
#include <rtsg/documents/writer.h>

namespace rtsg::detail {

/// A list of numbers whose text would take much more memory than it does.
bool isLongList(const Value& value);

struct WaitingText {
    std::string text;
    std::uint64_t at = 0, stored = 0;  // bytes of the file, behind the text
    Value numbers{};                   // behind both, if it is a long list
    std::size_t indent = 0;            // of its lines
    std::size_t counted = 0;           // its bytes among those that are held

    WaitingText(std::string some = {}) : text(std::move(some)) {}
    /// Nothing may be added to its text: something stands behind that.
    bool isClosed() const { return stored != 0 || isLongList(numbers); }
};
using Rope = std::list<WaitingText>;

class Waiting {
  public:
    /// Appends a list's text, and calls the function every so often: that may empty the text.
    using PrintList = std::function<void(std::string&, const WaitingText&, const std::function<void()>&)>;

    explicit Waiting(PrintList print) : print_(std::move(print)) {}
    ~Waiting();
    Waiting(const Waiting&) = delete;
    Waiting& operator=(const Waiting&) = delete;

    /// Appends the piece, or joins it with the last one.
    void add(Rope& rope, WaitingText piece);
    void add(Rope& rope, Rope&& pieces);
    /// Joins the piece at `at` with the one before it, if they are short; otherwise settles the one before it. Returns
    /// the piece that now holds its text.
    Rope::iterator join(Rope& rope, Rope::iterator at);
    /// Nothing more will be added to its text: it may go into the file, and its list too.
    void settle(WaitingText& piece);
    /// Passes all of it on; false if the file cannot be read.
    bool send(WaitingText& piece, const TextSink& sink);
    /// Nothing waits any more.
    void clear();

  private:
    bool store(std::string_view text, WaitingText& piece);
    bool storeList(WaitingText& piece);
    bool isMuch() const;

    PrintList print_;
    std::size_t held_ = 0, longest_ = 0;  // bytes in memory that are settled; of the longest list among them
    std::uint64_t size_ = 0;
    int file_ = -1;
    bool failed_ = false;  // there is no file, or no room
};

}  // namespace rtsg::detail
