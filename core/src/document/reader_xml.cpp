// Drives expat, and hands its elements to the ElementReader. Entities are not expanded.
#include "reader_xml.h"

#include <algorithm>
#include <new>

namespace rtsg::detail {

bool readXml(std::string_view text, bool utf8, DocumentHandler& handler, Diagnostics& diagnostics,
             const ReaderProgress& progress) {
    return XmlReader(text, utf8, handler, diagnostics, progress).read();
}

XmlReader::XmlReader(std::string_view text, bool utf8, DocumentHandler& handler, Diagnostics& diagnostics,
                     const ReaderProgress& progress)
    : ElementReader(Encoding::xml, handler, diagnostics),
      text_(text),
      utf8_(utf8),
      position_(text.data()),
      meter_(text.size(), progress),
      parser_(XML_ParserCreate(nullptr)) {
    if (!parser_) throw std::bad_alloc();
}

XmlReader::~XmlReader() {
    XML_ParserFree(parser_);
}

bool XmlReader::read() {
    XML_SetUserData(parser_, this);
    XML_SetElementHandler(
        parser_,
        [](void* self, const char* name, const char** attributes) {
            static_cast<XmlReader*>(self)->startElement(name, attributes);
        },
        [](void* self, const char*) { static_cast<XmlReader*>(self)->end(); });
    XML_SetCharacterDataHandler(parser_, [](void* self, const char* characters, int count) {
        static_cast<XmlReader*>(self)->text({characters, static_cast<std::size_t>(count)});
    });
    XML_SetCdataSectionHandler(
        parser_, [](void* self) { static_cast<XmlReader*>(self)->beginSection(); },
        [](void* self) { static_cast<XmlReader*>(self)->endSection(); });
    // Entities of the document's own are expanded, within these limits; nothing is fetched for them.
    XML_SetBillionLaughsAttackProtectionMaximumAmplification(parser_, kMaximumAmplification);
    XML_SetBillionLaughsAttackProtectionActivationThreshold(parser_, kAmplificationFrom);
    XML_SetEntityDeclHandler(parser_, [](void* user, const char* entity, int isParameter, const char* value, int,
                                         const char*, const char*, const char*, const char*) {
        auto* self = static_cast<XmlReader*>(user);
        if (!isParameter && !value)
            self->error("the entity " + std::string(entity) + " is in another file, which is not opened");
    });
    std::string_view rest = text_;
    XML_Status status = XML_STATUS_OK;
    std::size_t size = kSmallestPart;
    do {
        const std::size_t count = std::min(rest.size(), size), elements = elements_;
        const std::string_view part = rest.substr(0, count);
        rest.remove_prefix(count);
        status = XML_Parse(parser_, part.data(), static_cast<int>(count), rest.empty());
        // expat keeps a copy of what it could not finish and reads it again: within a long attribute larger parts make
        // the work grow with its length, not with the square of it.
        size = elements_ == elements ? std::min(2 * size, kLargestPart) : kSmallestPart;
    } while (status == XML_STATUS_OK && !rest.empty());
    if (status != XML_STATUS_OK) {
        const std::string inside = openElement().empty() ? "" : ", inside " + openElement();
        error(std::string("not well-formed XML: ") + XML_ErrorString(XML_GetErrorCode(parser_)) + inside +
              "; reading ends here");
    }
    if (!finish()) return false;
    meter_.finish();
    return status == XML_STATUS_OK;
}

void XmlReader::startElement(const char* name, const char** attributes) {
    ++elements_;
    meter_.at(static_cast<std::size_t>(std::max<XML_Index>(XML_GetCurrentByteIndex(parser_), 0)));
    start(name, attributes, XML_GetSpecifiedAttributeCount(parser_));
}

SourceLocation XmlReader::where() {
    if (utf8_) return locate(nullptr);
    return {static_cast<std::uint32_t>(XML_GetCurrentLineNumber(parser_)),
            static_cast<std::uint32_t>(XML_GetCurrentColumnNumber(parser_) + 1)};
}

/// Where `at`, in the value of the attribute being parsed, stands in the text; null: where the element starts.
SourceLocation XmlReader::locate(const char* at) {
    if (!utf8_) return where();
    const XML_Index index = XML_GetCurrentByteIndex(parser_);
    const std::size_t start = index < 0 ? text_.size() : std::min(static_cast<std::size_t>(index), text_.size());
    const char* s = text_.data() + start;
    const char* stop = text_.data() + text_.size();
    if (!at || !parsedAttribute()) return position_.of(s);
    // expat hands out copies: find the attribute again in the element's tag.
    const char* element = s;
    const std::string_view name(parsedAttribute());
    while (s != stop && !isSeparator(*s)) ++s;
    for (;;) {
        while (s != stop && *s != '=' && *s != '>') ++s;
        if (s == stop || *s == '>') return position_.of(element);
        const char* nameEnd = s;
        while (nameEnd != element && isSpace(nameEnd[-1])) --nameEnd;
        const bool found = std::string_view(element, static_cast<std::size_t>(nameEnd - element)).ends_with(name) &&
                           isSpace(nameEnd[-static_cast<std::ptrdiff_t>(name.size()) - 1]);
        ++s;
        while (s != stop && *s != '"' && *s != '\'') ++s;
        if (s == stop) return position_.of(element);
        const char quote = *s++;
        if (found) {
            for (std::ptrdiff_t offset = at - parsedValue(); offset > 0 && s != stop && *s != quote; --offset) {
                if (*s == '&')
                    while (s != stop && *s != ';' && *s != quote) ++s;
                if (s != stop) ++s;
            }
            return position_.of(s);
        }
        while (s != stop && *s != quote) ++s;
        if (s == stop) return position_.of(element);
        element = s++;
    }
}

}  // namespace rtsg::detail
