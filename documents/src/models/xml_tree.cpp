// Reads XML into a tree by expat.
#include "xml_tree.h"

#include <algorithm>

#include "commands/xml_parser.h"

namespace rtsg::detail {

namespace {

constexpr std::size_t kMaxElements = 1'000'000;
constexpr std::size_t kPiece = 1 << 30;  // bytes that expat gets at once: it begins long tokens again with each piece

constexpr std::string_view kWhite = " \t\r\n";

struct Building {
    Building(std::vector<XmlElement>& all, Diagnostics& diagnostics)
        : elements(all),
          parser([this, &diagnostics](std::string what) { diagnostics.error(where(), std::move(what)); }) {}

    std::vector<XmlElement>& elements;
    std::vector<std::uint32_t> open{};
    bool full = false;
    XmlParser parser;

    SourceLocation where() const {
        return {static_cast<std::uint32_t>(XML_GetCurrentLineNumber(parser)),
                static_cast<std::uint32_t>(XML_GetCurrentColumnNumber(parser)) + 1};
    }
    void begin(const char* name, const char** attributes) {
        if (elements.size() == kMaxElements) {
            full = true;
            XML_StopParser(parser, XML_FALSE);
            return;
        }
        const auto number = static_cast<std::uint32_t>(elements.size());
        if (!open.empty()) elements[open.back()].children.push_back(number);
        XmlElement& element = elements.emplace_back();
        element.name = name;
        element.where = where();
        for (; *attributes; attributes += 2) element.attributes.emplace_back(attributes[0], attributes[1]);
        open.push_back(number);
    }
    void text(std::string_view more) {
        if (open.empty()) return;
        std::string& all = elements[open.back()].text;
        if (all.empty()) more.remove_prefix(std::min(more.find_first_not_of(kWhite), more.size()));
        all += more;
    }
    void end() {
        std::string& all = elements[open.back()].text;
        all.resize(all.find_last_not_of(kWhite) + 1);  // npos + 1 is 0
        open.pop_back();
    }
};

}  // namespace

const std::string* XmlElement::attribute(std::string_view wanted) const {
    const auto found =
        std::ranges::find(attributes, wanted, [](const auto& one) -> std::string_view { return one.first; });
    return found == attributes.end() ? nullptr : &found->second;
}

const XmlElement* XmlTree::child(const XmlElement& parent, std::string_view name) const {
    for (const std::uint32_t child : parent.children)
        if (elements_[child].name == name) return &elements_[child];
    return nullptr;
}

bool XmlTree::read(std::string_view text, Diagnostics& diagnostics) {
    Building building(elements_, diagnostics);
    const XML_Parser parser = building.parser;
    building.parser.giveHandlers<&Building::parser>(building);
    XML_SetElementHandler(
        parser,
        [](void* self, const char* name, const char** attributes) {
            static_cast<Building*>(self)->begin(name, attributes);
        },
        [](void* self, const char*) { static_cast<Building*>(self)->end(); });
    XML_SetCharacterDataHandler(parser, [](void* self, const char* characters, int length) {
        static_cast<Building*>(self)->text({characters, static_cast<std::size_t>(length)});
    });
    XML_Status status = XML_STATUS_OK;
    do {
        const std::string_view piece = text.substr(0, kPiece);
        text.remove_prefix(piece.size());
        status = XML_Parse(parser, piece.data(), static_cast<int>(piece.size()), text.empty());
    } while (status == XML_STATUS_OK && !text.empty());
    if (status == XML_STATUS_OK) return true;
    if (building.parser.isRefused()) return false;
    diagnostics.error(building.where(),
                      building.full ? "there are more than a million elements; reading ends here"
                                    : std::string("not well-formed XML: ") + XML_ErrorString(XML_GetErrorCode(parser)));
    return false;
}

}  // namespace rtsg::detail
