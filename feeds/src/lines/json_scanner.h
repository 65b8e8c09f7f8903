// JsonScanner: reads one JSON object on a line, value by value, and keeps the text of numbers.
//
// Invariant: it never reads beyond its text, and its stack does not grow with the nesting of what it skips.
// Threading: values. Source: RFC 8259.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include <rtsg/core/diagnostic.h>

namespace rtsg::feeds {

class JsonScanner {
  public:
    explicit JsonScanner(std::string_view text) : text_(text) {}

    /// Skips white space. True if `c` is next, which is then read.
    bool take(char c);
    /// The next character after white space; '\0' at the end.
    char next();
    bool atEnd() {
        (void)next();
        return at_ == text_.size();
    }
    /// False, and an error, unless a string is next.
    bool string(std::string& into);
    /// A number, true, false or null, as it is written.
    bool word(std::string_view& into);
    /// Any value, however nested.
    bool skip();
    /// Sets the error, at the place that was reached, unless there is one.
    bool refuse(std::string text);
    bool failed() const { return !problem_.text.empty(); }
    const Diagnostic& problem() const { return problem_; }

  private:
    bool escape(std::string& into);
    bool codeUnit(unsigned& unit);

    std::string_view text_;
    std::size_t at_ = 0;
    Diagnostic problem_;
};

}  // namespace rtsg::feeds
