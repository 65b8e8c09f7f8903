// Reader of the XML encoding, on expat.
//
// Invariant: entities declared in the document are expanded to at most kMaximumAmplification times what was read
// (expat's own limit), external ones are never fetched, attribute defaults of a DTD ignored; beside the text, memory
// grows with the largest attribute only. XML that is not well-formed ends the reading there. Threading: one thread a
// document. Source: ISO/IEC 19776-1 V3.3.
#pragma once

// expat declares its limits on entities only where this is said; Debian builds it so.
#define XML_DTD 1
#include <expat.h>

#include "reader_element.h"
#include "value/text_position.h"

namespace rtsg::detail {

class XmlReader final : private ElementReader {
  public:
    XmlReader(std::string_view text, bool utf8, DocumentHandler& handler, Diagnostics& diagnostics,
              const ReaderProgress& progress);
    ~XmlReader() override;
    XmlReader(const XmlReader&) = delete;
    XmlReader& operator=(const XmlReader&) = delete;
    bool read();

  private:
    static constexpr float kMaximumAmplification = 20;
    static constexpr unsigned long long kAmplificationFrom = 1 << 20;  // bytes
    static constexpr std::size_t kSmallestPart = 1 << 20, kLargestPart = 1 << 30;

    void startElement(const char* name, Attributes attributes);
    SourceLocation where() override;
    SourceLocation locate(const char* at) override;

    std::string_view text_;
    bool utf8_;
    TextPosition position_;
    ProgressMeter meter_;
    std::size_t elements_ = 0;  // begun so far
    XML_Parser parser_;
};

}  // namespace rtsg::detail
