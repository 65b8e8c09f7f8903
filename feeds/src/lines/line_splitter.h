// LineSplitter: cuts a stream of bytes into lines, however they come.
//
// Invariant: it holds at most kLongestLine bytes. A longer line is left out, and named once.
// Threading: one thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace rtsg::feeds {

/// A field of a hundred thousand numbers fits.
inline constexpr std::size_t kLongestLine = std::size_t{1} << 20;

class LineSplitter {
  public:
    /// Calls `take(line, tooLong)` for each line that has ended. A line that is too long is cut.
    template <class Take>
    void add(std::string_view bytes, Take&& take) {
        while (!bytes.empty()) {
            const std::size_t end = bytes.find('\n');
            const std::string_view piece = bytes.substr(0, end);
            if (rest_.empty() && !tooLong_ && end != bytes.npos && piece.size() <= kLongestLine) {
                take(piece, false);
            } else {
                keep(piece);
                if (end == bytes.npos) return;
                finish(take);
            }
            bytes.remove_prefix(end + 1);
        }
    }
    /// The stream has ended: the rest is a line.
    template <class Take>
    void finish(Take&& take) {
        if (!rest_.empty()) take(std::string_view(rest_), tooLong_);
        rest_.clear();
        rest_.shrink_to_fit();
        tooLong_ = false;
    }

  private:
    void keep(std::string_view piece) {
        if (rest_.size() + piece.size() > kLongestLine) {
            tooLong_ = true;
            piece = piece.substr(0, kLongestLine - rest_.size());
        }
        rest_ += piece;
    }

    std::string rest_;
    bool tooLong_ = false;
};

}  // namespace rtsg::feeds
