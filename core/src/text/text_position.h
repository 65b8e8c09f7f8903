// Line and column of a byte in a text, found by counting on from the last one asked for.
//
// Columns count code points, so that they agree with editors. Asking in ascending order costs one pass over the text
// in all; going back is allowed and costs the way back to the line's start. Threading: one thread.
#pragma once

#include <cstring>

#include <rtsg/core/diagnostic.h>

#include "find_bytes.h"

namespace rtsg::detail {

class TextPosition {
  public:
    explicit TextPosition(const char* begin) : begin_(begin), at_(begin) {}

    SourceLocation of(const char* p) {
        if (p < at_) goBack(p);
        if (const std::uint32_t lines = newlines(at_, p)) {
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
        const std::size_t continued = countMasked(from, to, 0xC0, 0x80);
        return static_cast<std::uint32_t>(static_cast<std::size_t>(to - from) - continued);
    }
    static std::uint32_t newlines(const char* from, const char* to) {
        return static_cast<std::uint32_t>(countMasked(from, to, 0xFF, '\n'));
    }
    void goBack(const char* p) {
        if (p >= lineStart_) {
            column_ -= codePoints(p, at_);
            at_ = p;
            return;
        }
        line_ -= newlines(p, at_);
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
