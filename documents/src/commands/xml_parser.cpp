// Creates expat parsers, and bounds the entities and attributes that a document declares.
#include "xml_parser.h"

#include <algorithm>
#include <new>

namespace rtsg::detail {

XmlParser::XmlParser(std::function<void(std::string)> report)
    : parser_(XML_ParserCreate(nullptr), XML_ParserFree), report_(std::move(report)) {
    if (!parser_) throw std::bad_alloc();
    XML_SetBillionLaughsAttackProtectionMaximumAmplification(parser_.get(), kMaximumAmplification);
    XML_SetBillionLaughsAttackProtectionActivationThreshold(parser_.get(), kAmplificationFrom);
}

void XmlParser::refuse(const std::string& why) {
    if (refused_) return;
    refused_ = true;
    report_(why + "; reading ends here");
    XML_StopParser(parser_.get(), XML_FALSE);
}

std::uint32_t XmlParser::numberOf(std::string_view entity) {
    const auto [found, isNew] = numbers_.try_emplace(std::string(entity), static_cast<std::uint32_t>(entities_.size()));
    if (isNew) entities_.emplace_back();
    return found->second;
}

void XmlParser::declareEntity(std::string_view name, bool isParameter, bool isHere, std::string_view value) {
    if (++declared_ > kMaxEntities)
        return refuse("the document declares more than " + std::to_string(kMaxEntities) + " entities");
    if (isParameter) return;  // expat does not follow them
    if (!isHere) return report_("the entity " + std::string(name) + " is in another file, which is not opened");
    const std::uint32_t number = numberOf(name);
    std::uint32_t depth = 0;
    for (std::size_t at = 0; (at = value.find('&', at)) != value.npos;) {
        const std::size_t from = at + 1;
        at = std::min(value.find_first_of("&;", from), value.size());
        if (at == value.size() || value[at] != ';' || value[from] == '#') continue;
        const std::uint32_t within = numberOf(value.substr(from, at - from));
        if (auto& users = entities_[within].usedBy; users.empty() || users.back() != number) users.push_back(number);
        depth = std::max(depth, entities_[within].depth + 1);
    }
    deepen(number, depth);
}

/// An entity may name others before they are declared: those that name it become deeper with it. Each becomes so at
/// most kDeepest times.
void XmlParser::deepen(std::uint32_t entity, std::uint32_t depth) {
    std::vector<std::pair<std::uint32_t, std::uint32_t>> changed{{entity, depth}};
    while (!changed.empty()) {
        const auto [number, level] = changed.back();
        changed.pop_back();
        if (level <= entities_[number].depth) continue;
        if (level > kDeepest)
            return refuse("entities stand more than " + std::to_string(kDeepest) + " deep within each other");
        entities_[number].depth = level;
        for (const std::uint32_t user : entities_[number].usedBy) changed.emplace_back(user, level + 1);
    }
}

void XmlParser::declareAttribute() {
    if (++attributes_ > kMaxAttributes)
        refuse("the document type declares more than " + std::to_string(kMaxAttributes) + " attributes");
}

}  // namespace rtsg::detail
