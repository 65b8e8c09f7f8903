// Reader of the XML encoding, on expat.
//
// Invariant: entities declared in the document are refused (they can blow up), external ones are never fetched,
// attribute defaults of a DTD ignored. XML that is not well-formed ends the reading there. Threading: one thread a
// document. Source: ISO/IEC 19776-1 V3.3.
#pragma once

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
    void startElement(const char* name, Attributes attributes);
    SourceLocation where() override;
    SourceLocation locate(const char* at) override;

    std::string_view text_;
    bool utf8_;
    TextPosition position_;
    ProgressMeter meter_;
    bool refusedEntity_ = false;
    XML_Parser parser_;
};

}  // namespace rtsg::detail
