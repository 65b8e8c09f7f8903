// Reader of the XML encoding, on expat; attributes of many numbers that are too long for it are read past it.
//
// Invariant: entities declared in the document are expanded within the bounds of XmlParser, external ones are never
// fetched, attribute defaults of a DTD ignored. Beside a few megabytes of the text, memory grows with the largest
// attribute only, and where that is a list of numbers, with its value only. XML that is not well-formed ends the
// reading there. Threading: one thread a document. Source: ISO/IEC 19776-1 V3.3.
#pragma once

#include <deque>

#include "commands/xml_parser.h"
#include "reader_element.h"
#include "text/text_position.h"
#include "text_feed.h"

namespace rtsg::detail {

class XmlReader final : private ElementReader {
  public:
    XmlReader(TextFeed& text, bool utf8, DocumentHandler& handler, Diagnostics& diagnostics,
              const ReaderOptions& options);
    XmlReader(const XmlReader&) = delete;
    XmlReader& operator=(const XmlReader&) = delete;
    bool read();

  private:
    static constexpr std::size_t kPart = 1 << 18;
    static constexpr std::ptrdiff_t kLong = 1 << 16;  // an attribute from which on it is read past expat
    static constexpr std::ptrdiff_t kKept = 1 << 20;  // of the text behind the place where reading is

    /// The construct that the text before the next attribute value is in, as far as it has been looked at.
    enum class In : std::uint8_t { content, comment, section, instruction, declaration, tag, quoted, opaque };
    struct Skipped {
        std::uint64_t index;  // of expat's bytes
        std::uint64_t more;   // bytes of the text that it has not seen before that
    };
    struct Early {
        std::string placeholder;
        Value value;
        std::uint64_t index;   // of expat's bytes, where the placeholder starts
        SourceLocation tagAt;  // the element's place, since its text may be gone
    };
    class LongValue;

    bool feed(const char* from, const char* to, bool last);
    bool feedAll();
    const char* scan(const char* from, const char* to);
    In whatBegins(char next);
    const char* scanDeclaration(const char* p, const char* to);
    const char* readLong(const char* quote);
    const Early* earlyHere() const;
    const char* findMark(const char* from, const char* end) const;
    FieldType typeOfLong(const char* quote) const;
    bool isBareAmpersand(const char* p) const;
    void release(const char* upTo);
    std::uint64_t textIndex(std::uint64_t expatIndex) const;

    void startElement(const char* name, Attributes attributes);
    SourceLocation where() override;
    SourceLocation locate(const char* at) override;
    const char* findAttribute(std::string_view name);
    Value* parsedBefore(const char* text) override;

    TextFeed& feed_;
    bool utf8_;
    TextPosition position_;
    const char* released_;
    ProgressMeter meter_;
    const Splitting splitting_;
    XmlParser parser_;
    XML_Status status_ = XML_STATUS_OK;

    In in_ = In::content;
    const char* opened_ = nullptr;  // the `<` of a tag, or the quote of a value
    const char* tag_ = nullptr;     // the `<` of the tag that the value is in
    char quote_ = 0;
    // For text in memory: the start of the last value that was searched through, and the place of its end, of a `<` or
    // of a `&`.
    mutable const char *wholeQuote_ = nullptr, *wholeEnd_ = nullptr;
    int depth_ = 0;          // of brackets in a declaration
    std::uint64_t fed_ = 0;  // bytes that expat has been given
    /// The element whose position was asked for last.
    struct Located {
        std::int64_t index = -1;  // of expat's bytes
        SourceLocation element{};
        std::string attribute{};
        const char* value = nullptr;  // the quote that opens the attribute's value; null: not found
        const char* next = nullptr;   // where the next attributes stand
    } located_;
    std::deque<Skipped> skipped_;
    std::vector<Early> early_;
    // The tag that has had a long value; its text may be gone.
    const char* longTag_ = nullptr;
    const char* longEnd_ = nullptr;  // of its last long value
    std::string longElement_, longField_;
    SourceLocation longAt_;
};

}  // namespace rtsg::detail
