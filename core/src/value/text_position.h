// Line and column of a byte in a text, found by counting on from the last one asked for.
//
// Columns count code points, so that they agree with editors. Asking in ascending order costs one pass over the text
// in all; going back is allowed and costs the way back to the line's start. Threading: one thread.
#pragma once

#include <cstring>

#include <rtsg/core/diagnostic.h>

namespace rtsg::detail {

class TextPosition {
  public:
    explicit TextPosition(const char* begin) : begin_(begin), at_(begin) {}

    SourceLocation of(const char* p) {
        if (p < at_) goBack(p);
        std::uint32_t lines = 0;
        for (const char* q = at_; q != p; ++q) lines += *q == '\n';
        if (lines) {
            lineStart_ = static_cast<const char*>(memrchr(at_, '\n', static_cast<std::size_t>(p - at_))) + 1;
            line_ += lines;
            column_ = 1;
            at_ = lineStart_;
        }
        column_ += codePoints(at_, p);
        at_ = p;
        return {line_, column_};
    }

  private:
    static std::uint32_t codePoints(const char* from, const char* to) {
        std::uint32_t count = 0;
        for (; from != to; ++from) count += (static_cast<unsigned char>(*from) & 0xC0u) != 0x80u;
        return count;
    }
    void goBack(const char* p) {
        if (p >= lineStart_) {
            column_ -= codePoints(p, at_);
            at_ = p;
            return;
        }
        for (const char* q = p; q != at_; ++q) line_ -= *q == '\n';
        while (p != begin_ && p[-1] != '\n') --p;
        at_ = lineStart_ = p;
        column_ = 1;
    }

    const char* begin_;
    const char* at_;
    const char* lineStart_ = begin_;
    std::uint32_t line_ = 1, column_ = 1;
};

}  // namespace rtsg::detail
