// The text of a document as it arrives: in pieces, one behind the other at addresses that never change, so that readers
// keep pointers into it; text that they have finished goes back to the system.
//
// Invariant: [begin(), end()) of a file is valid UTF-8, unless decideBy() says that it is no such text (invalid bytes
// are replaced, and counted); text before the last release() is gone. Memory in use is the text that was read and not
// released. A file is read, not mapped: whoever truncated a mapped
// file would end the process. Threading: one thread a feed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include <rtsg/core/diagnostic.h>

namespace rtsg::detail {

class TextFeed {
  public:
    static constexpr std::size_t kHead = 1 << 12;  // enough to tell the encoding

    /// All of it is there already; the view must outlive the feed.
    explicit TextFeed(std::string_view text);
    /// Opens the text of an open file, which is plain or gzip, as its first bytes say. It may have `limit` bytes at
    /// most, unpacked. `block` bytes are read at a time. The caller closes the descriptor afterwards.
    static Result<std::unique_ptr<TextFeed>> of(int descriptor, std::uint64_t limit, std::size_t block = 1 << 20);
    /// Likewise, of bytes in memory, which must outlive the feed.
    static Result<std::unique_ptr<TextFeed>> ofMemory(std::string_view bytes, std::uint64_t limit);
    /// Another feed of the same text, from begin() as it is now. Null where the text can be had only once (a pipe).
    std::unique_ptr<TextFeed> again() const;
    ~TextFeed();
    TextFeed(const TextFeed&) = delete;
    TextFeed& operator=(const TextFeed&) = delete;

    const char* begin() const { return begin_; }
    const char* end() const { return end_; }
    /// Reads on. False if there is no more; end() has moved otherwise.
    bool more();
    /// Asked before each block of a file: true ends the text there, and it is not a failure.
    void stopWhen(std::function<bool()> enough) { enough_ = std::move(enough); }
    /// Asked once for the first bytes of a file, and its size where that is known: true makes the text valid UTF-8.
    void decideBy(std::function<bool(std::string_view head, std::uint64_t size)> isText) {
        isText_ = std::move(isText);
    }
    /// It has ended so.
    bool wasStopped() const { return stopped_; }
    /// Reads to the end, or until there are `size` bytes.
    void fill(std::size_t size = SIZE_MAX);
    /// Nothing before `upTo` is looked at again.
    void release(const char* upTo);
    /// Overwrites text with spaces. False where the text is not ours.
    bool blank(const char* from, const char* to);
    /// All of it is there, and not ours.
    bool isComplete() const { return !source_; }
    /// Skips a byte order mark; before anything is looked at.
    void skip(std::size_t bytes) {
        begin_ += bytes;
        skipped_ += bytes;
    }

    /// How long the text is, as far as that can be told before it is read; else 0.
    std::uint64_t size() const;
    /// Bytes of the file read where the text has been used up to `at`, and in all (0 if unknown): for progress.
    std::uint64_t done(const char* at) const;
    std::uint64_t total() const;
    /// Bytes that were no UTF-8, and where the first was.
    std::size_t invalid() const { return invalid_; }
    SourceLocation firstInvalid() const { return firstInvalid_; }
    /// Why there is no more, if that is not the end of the file; a gzip file's text up to there is used.
    const std::string& failure() const { return failure_; }

  private:
    struct Source;
    explicit TextFeed(std::unique_ptr<Source> source);
    static Result<std::unique_ptr<TextFeed>> of(std::unique_ptr<Source> source, std::uint64_t longest);
    bool mayReadOn();
    std::size_t read(char* to, std::size_t maximum);
    void clean(char* from, std::size_t size, bool last);

    const char* begin_ = nullptr;
    const char* end_ = nullptr;
    std::size_t skipped_ = 0;
    std::unique_ptr<Source> source_;  // null: all is there
    bool clean_ = true;
    std::size_t invalid_ = 0;
    SourceLocation firstInvalid_;
    std::string failure_;
    std::function<bool()> enough_;
    std::function<bool(std::string_view head, std::uint64_t size)> isText_;  // none: any is
    bool stopped_ = false;
};

}  // namespace rtsg::detail
