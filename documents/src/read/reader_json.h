// Reader of the JSON encoding: a first look (json_outline.h) matches brackets, so that the second can go through the
// text once, in blocks, and forget what is behind it.
//
// Invariant: an explicit stack throughout; only text that the first look has passed is read. Beside a few megabytes of
// the text, memory grows with the largest attribute, and with objects whose attributes stand behind their other
// members. Threading: one thread a document. Source: X3D JSON encoding, ISO/IEC 19776-5 draft: "@name" attributes,
// "-field" nodes, "#comment", "#sourceCode".
#pragma once

#include <algorithm>
#include <charconv>

#include "json_outline.h"
#include "reader_element.h"
#include "text/text_position.h"

namespace rtsg::detail {

class JsonReader final : private ElementReader {
  public:
    JsonReader(TextFeed& text, JsonOutline outline, DocumentHandler& handler, Diagnostics& diagnostics,
               const ReaderOptions& options)
        : ElementReader(Encoding::json, handler, diagnostics, options.dialect),
          feed_(text),
          outline_(std::move(outline)),
          position_(text.begin()),
          begin_(text.begin()),
          released_(begin_),
          p_(begin_),
          meter_(text.total(), options.progress),
          splitting_(options.splitting) {
        findEnd();
    }

    bool read();

  private:
    enum class Inside : std::uint8_t {
        wrapper,   // { "Type": { ... } }: the members are elements
        element,   // the members of an element besides its attributes
        nodes,     // an array of wrappers
        elements,  // an array of elements of one name
    };
    struct Frame {
        Inside inside;
        std::string name;  // elements: of each
        std::string containerField;
    };
    /// A list of numbers that was read past attributes_.
    struct Early {
        std::size_t index;  // of its placeholder in attributes_
        Value value;
        SourceLocation where;
    };
    class LongValue;

    SourceLocation where() override { return where_; }
    SourceLocation locate(const char*) override;
    Value* parsedBefore(const char* text) override {
        for (Early& early : early_)
            if (attributes_[early.index] == text) return &early.value;
        return nullptr;
    }
    const Early* earlyAt(std::size_t index) const {
        const auto found = std::ranges::find(early_, index, &Early::index);
        return found == early_.end() ? nullptr : &*found;
    }

    // ---- text
    /// What is there so far, of what the first look let through.
    void findEnd() {
        const auto size = static_cast<std::uint64_t>(feed_.end() - begin_);
        end_ = begin_ + std::min(size, outline_.end);
    }
    bool grow() {
        const char* const before = end_;
        if (!feed_.more()) return false;
        findEnd();
        return end_ != before;
    }
    /// There is a character at `p`, maybe one that had to be fetched.
    bool there(const char* p) { return p < end_ || (grow() && there(p)); }
    char at(const char* p) { return there(p) ? *p : '\0'; }
    void release(const char* upTo) {
        constexpr std::ptrdiff_t kept = 1 << 20;  // behind the place where reading is
        if (held_ || upTo - released_ < 2 * kept) return;
        released_ = upTo - kept;
        position_.of(released_);
        feed_.release(released_);
    }

    // ---- tokens
    const char* skipSpace(const char* p) {
        while (there(p) && isSpace(*p)) ++p;
        return p;
    }
    /// Behind the closing quote of the string that starts at `p`.
    const char* stringEnd(const char* p);
    const char* valueEnd(const char* p);
    /// Behind the bracket that closes the outermost of so many open ones.
    const char* behindClose(const char* p, std::size_t depth);

    /// The next member of an object: its key; `p` is then at its value. False at the object's end, where `p` is then.
    bool nextMember(const char*& p, std::string& key);
    void complain(const char* p, std::string text) {
        where_ = position_.of(std::min(p, end_));
        error(std::move(text));
    }
    /// The text of the string literal in [start, end), quotes included.
    std::string unescaped(const char* start, const char* end);
    static bool hexadecimal(const char* p, const char* stop, std::uint32_t& out) {
        if (stop - p < 6 || p[0] != '\\' || p[1] != 'u') return false;
        return std::from_chars(p + 2, p + 6, out, 16).ptr == p + 6;
    }
    const char* appendUnicode(std::string& out, const char* p, const char* stop);

    // ---- what the text says
    void step();
    void leave();
    /// Leaves the value out that p_ is at.
    void skip(const char* complaintAt, std::string why) {
        complain(complaintAt, std::move(why));
        p_ = std::max(valueEnd(p_), std::min(p_ + 1, end_));
    }

    /// Starts the element whose object is at p_.
    void element(const std::string& name, const std::string& containerField);
    void attributesInFront(const std::string& name);
    /// Reads a value that is neither an attribute nor a node. Returns where it ends.
    const char* scalar(const std::string& key) {
        if (key != "encoding" && key != "JSON schema") complain(p_, "'" + key.substr(0, 80) + "' is unknown here");
        return std::max(valueEnd(p_), std::min(p_ + 1, end_));
    }

    /// Takes the attribute's value, which is at p_.
    void attribute(const std::string& element, const std::string& name);
    /// The value of an attribute of this element that has come already.
    std::string given(std::string_view name) const {
        for (std::size_t i = 0; i + 1 < strings_.size(); i += 2)
            if (strings_[i] == name) return strings_[i + 1];
        return {};
    }

    /// A value as the text of an XML attribute; false for null and for values that are no attribute.
    bool attributeText(const char* value, const char* end, std::string& out);

    /// Whether the array at `value` is worth reading in place. If brackets within it cannot be turned into white space,
    /// it must have none. Sets listEnd_.
    bool isLong(const char* value);
    void longValue(const std::string& name, FieldType type);

    void member(const std::string& key);
    /// One, or an array of them.
    void comments();
    void oneComment();
    void source();
    void sourceLines();

    TextFeed& feed_;
    const JsonOutline outline_;
    TextPosition position_;
    const char* const begin_;
    const char* released_;
    const char* end_ = nullptr;
    const char* p_;
    bool held_ = false;              // nothing is given back
    const char* listEnd_ = nullptr;  // where the list that isLong() has looked at ends, if that is known
    ProgressMeter meter_;
    const Splitting splitting_;
    std::vector<Frame> frames_;
    SourceLocation where_;
    std::vector<std::string> strings_;  // of the element being started
    std::vector<const char*> attributes_;
    std::vector<const char*> valuePositions_;
    std::vector<Early> early_;
};

}  // namespace rtsg::detail
