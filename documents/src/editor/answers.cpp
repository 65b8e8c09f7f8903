// Completes, explains and finds words of a document, by the tables of node types and by the document's definitions.
#include "answers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>
#include <rtsg/core/node_type.h>
#include <rtsg/documents/read_document.h>

#include "document_words.h"

namespace rtsg::editor {

namespace {

using Expects = WordsEnd::Expects;

/// The components in the order of their clauses, which are 7 to 42.
constexpr std::string_view kComponents[] = {"Core",
                                            "Time",
                                            "Networking",
                                            "Grouping",
                                            "Rendering",
                                            "Shape",
                                            "Geometry3D",
                                            "Geometry2D",
                                            "Text",
                                            "Sound",
                                            "Lighting",
                                            "Texturing",
                                            "Interpolation",
                                            "PointingDeviceSensor",
                                            "KeyDeviceSensor",
                                            "EnvironmentalSensor",
                                            "Navigation",
                                            "EnvironmentalEffects",
                                            "Geospatial",
                                            "HAnim",
                                            "NURBS",
                                            "DIS",
                                            "Scripting",
                                            "EventUtilities",
                                            "Shaders",
                                            "CADGeometry",
                                            "Texturing3D",
                                            "CubeMapTexturing",
                                            "Layering",
                                            "Layout",
                                            "RigidBodyPhysics",
                                            "Picking",
                                            "Followers",
                                            "ParticleSystems",
                                            "VolumeRendering",
                                            "TextureProjection"};

std::string_view accessText(Access access) {
    constexpr std::array<std::string_view, 4> kTexts = {"[]", "[in]", "[out]", "[in,out]"};
    return kTexts[static_cast<std::size_t>(access)];
}

/// "SFVec3f [in,out] translation 0 0 0", in the notation of the standard.
std::string fieldLine(const FieldDef& field) {
    std::string line = fmt::format("{} {} {}", field.typeName(), accessText(field.access), field.name);
    const bool hasValue = field.access == Access::initializeOnly || field.access == Access::inputOutput;
    if (!hasValue) return line;
    if (field.type == FieldType::SFNode) return line + " NULL";
    line += ' ';
    line += isMF(field.type) && field.type == FieldType::MFNode ? "[]" : printFieldText(field.defaultValue);
    if (field.bounded())
        line += fmt::format(" {}{}, {}{}", field.exclusiveMin || std::isinf(field.min) ? '(' : '[', field.min,
                            field.max, field.exclusiveMax || std::isinf(field.max) ? ')' : ']');
    for (std::size_t i = 0; i < field.allowed.size(); ++i)
        line += fmt::format("{}\"{}\"", i == 0 ? " [" : "|", field.allowed[i]);
    if (!field.allowed.empty()) line += ']';
    if (!field.accepts.empty()) line += fmt::format(" [{}]", fmt::join(field.accepts, ","));
    return line;
}

std::string sectionOf(const NodeType& type) {
    const int clause = clauseOf(type.component);
    std::string text = fmt::format("{} component, level {}", type.component, type.level);
    if (clause > 0) text += fmt::format("; ISO/IEC 19775-1 V4.0, clause {}", clause);
    if (type.since > 0)
        text += type.since == 20 ? std::string("; since VRML97")
                                 : fmt::format("; since X3D {}.{}", type.since / 10, type.since % 10);
    return text;
}

std::string nodeText(const NodeType& type) {
    std::string text = fmt::format("**{}**", type.name);
    if (!type.implements.empty()) text += fmt::format(": {}", fmt::join(type.implements, ", "));
    text += fmt::format("\n\n{}\n\n```\n", sectionOf(type));
    for (const FieldDef& field : type.fields)
        if (!field.hidden) text += fieldLine(field) + '\n';
    return text + "```\n";
}

std::string fieldText(const NodeType& type, const FieldDef& field) {
    static constexpr std::array<std::string_view, 10> kUnits = {
        "", "length", "angle", "mass", "force", "speed", "angular rate", "acceleration", "area", "torque"};
    std::string text = fmt::format("```\n{}\n```\n", fieldLine(field));
    if (field.unit != Unit::none) text += fmt::format("Unit: {}. ", kUnits[static_cast<std::size_t>(field.unit)]);
    return text + fmt::format("Of {} ({})\n", type.name, sectionOf(type));
}

bool isXml(std::string_view text) {
    return detectEncoding(text.substr(0, 4096)) == Encoding::xml;
}

TextRange rangeOf(std::string_view text, std::string_view part) {
    const auto begin = static_cast<std::size_t>(part.data() - text.data());
    return {begin, begin + part.size()};
}

const Word* wordAt(const DocumentWords& words, std::string_view text, std::size_t offset) {
    for (const Word& word : words.words)
        if (const TextRange range = rangeOf(text, word.text); range.begin <= offset && offset <= range.end)
            return &word;
    return nullptr;
}

const NodeType* typeOf(const DocumentWords& words, std::size_t node) {
    return node == kNoNode ? nullptr : findBuiltinType(words.nodes[node].type);
}
/// The type of the node that has the name; null also for an instance of a PROTO.
const NodeType* typeOfName(const DocumentWords& words, std::string_view name) {
    for (const WordNode& node : words.nodes)
        if (!name.empty() && node.def == name) return findBuiltinType(node.type);
    return nullptr;
}
const FieldDef* fieldOf(const NodeType* type, std::string_view name) {
    const FieldIndex index = type ? type->find(name) : kNoField;
    return index == kNoField ? nullptr : &type->fields[index];
}

/// Null for a built-in type, and for one that nobody declares.
const WordProto* protoOf(const DocumentWords& words, std::string_view type) {
    if (findBuiltinType(type)) return nullptr;
    const auto found = std::ranges::find(words.protos, type, &WordProto::name);
    return found == words.protos.end() ? nullptr : &*found;
}
const WordProto* protoOf(const DocumentWords& words, std::size_t node) {
    return node == kNoNode ? nullptr : protoOf(words, words.nodes[node].type);
}
const WordProto* protoOfName(const DocumentWords& words, std::string_view name) {
    for (const WordNode& node : words.nodes)
        if (!name.empty() && node.def == name) return protoOf(words, node.type);
    return nullptr;
}
std::string fieldLine(const WordProto::Field& field) {
    return fmt::format("{} {} {}", field.access, field.type, field.name);
}
std::string protoText(const WordProto& proto) {
    std::string text = fmt::format("PROTO **{}**\n\n```\n", proto.name);
    for (const WordProto::Field& field : proto.fields) text += fieldLine(field) + '\n';
    return text + "```\n";
}

/// Collects proposals for one place.
class Proposer {
  public:
    Proposer(const DocumentWords& whole, const DocumentWords& before, bool xml)
        : whole_(whole), before_(before), end_(before.end), isXml_(xml) {}

    std::vector<Proposal> take() {
        switch (end_.expects) {
            case Expects::nodeType:
                nodes();
                break;
            case Expects::field:
                fields();
                break;
            case Expects::value:
                values();
                break;
            case Expects::use:
                names();
                break;
            case Expects::routeField:
                routeFields();
                break;
            case Expects::attribute:
                if (end_.field == "ROUTE")
                    for (const char* one : {"fromNode", "fromField", "toNode", "toField"})
                        add(Proposal::Kind::field, one);
                if (end_.field == "fieldValue") protoFields();
                break;
            case Expects::nothing:
                break;
        }
        return std::move(all_);
    }

  private:
    void add(Proposal::Kind kind, std::string_view text, std::string detail = {}) {
        all_.push_back({kind, std::string(text), std::move(detail)});
    }
    static bool takes(const FieldDef& field, const NodeType& child) {
        if (field.hidden || sf(field.type) != FieldType::SFNode || !field.readable() ||
            field.access == Access::outputOnly)
            return false;
        return field.accepts.empty() ||
               std::ranges::any_of(field.accepts, [&](const std::string& one) { return child.isA(one); });
    }
    void nodes() {
        const NodeType* parent = typeOf(before_, end_.node);
        const FieldDef* field = fieldOf(parent, end_.field);
        for (const auto& type : builtinTypes()) {
            if (type->internal) continue;
            const bool fits =
                !parent ? true
                : field ? takes(*field, *type)
                        : std::ranges::any_of(parent->fields, [&](const FieldDef& one) { return takes(one, *type); });
            if (fits) add(Proposal::Kind::node, type->name, fmt::format("{} component", type->component));
        }
        for (const Word& word : before_.words)
            if (word.kind == WordKind::proto) add(Proposal::Kind::node, word.text, "PROTO of this document");
        if (isXml_) {
            for (const char* one : {"ROUTE", "ProtoInstance"}) add(Proposal::Kind::keyword, one);
        } else {
            for (const char* one : {"DEF", "USE"}) add(Proposal::Kind::keyword, one);
            if (end_.node == kNoNode)
                for (const char* one : {"ROUTE", "PROTO", "EXTERNPROTO"}) add(Proposal::Kind::keyword, one);
        }
    }
    void fields() {
        const NodeType* type = typeOf(before_, end_.node);
        const auto& given = before_.nodes[end_.node].given;
        if (type)
            for (const FieldDef& field : type->fields) {
                const bool takesValue = field.access == Access::initializeOnly || field.access == Access::inputOutput;
                if (field.hidden || !takesValue || (isXml_ && sf(field.type) == FieldType::SFNode)) continue;
                // The field that is being written is among the given ones, and is proposed all the same.
                if (std::ranges::find(given, field.name) != given.end() && end_.begun != field.name) continue;
                add(Proposal::Kind::field, field.name, fieldLine(field));
            }
        if (!isXml_) protoFields();
        if (isXml_)
            for (const char* one : {"DEF", "USE", "containerField"}) add(Proposal::Kind::keyword, one);
    }
    void protoFields() {
        const WordProto* proto = protoOf(before_, end_.node);
        if (!proto) return;
        for (const WordProto::Field& field : proto->fields)
            if (field.access != "inputOnly" && field.access != "outputOnly" && field.access != "eventIn" &&
                field.access != "eventOut")
                add(Proposal::Kind::field, field.name, fieldLine(field));
    }
    void values() {
        const FieldDef* field = fieldOf(typeOf(before_, end_.node), end_.field);
        if (!field) return;
        if (sf(field->type) == FieldType::SFBool)
            for (const char* one : {"TRUE", "FALSE"})
                add(Proposal::Kind::value, isXml_ ? (one[0] == 'T' ? "true" : "false") : one);
        for (const std::string& one : field->allowed) add(Proposal::Kind::value, one);
    }
    /// A ROUTE may stand before the nodes that it names; a USE may not.
    void names() {
        for (const WordNode& node : end_.node == kNoNode ? whole_.nodes : before_.nodes)
            if (!node.def.empty()) add(Proposal::Kind::name, node.def, std::string(node.type));
    }
    void routeFields() {
        if (const WordProto* proto = protoOfName(whole_, end_.field))
            for (const WordProto::Field& field : proto->fields)
                if (field.access != "initializeOnly" && field.access != "field")
                    add(Proposal::Kind::field, field.name, fieldLine(field));
        const NodeType* type = typeOfName(whole_, end_.field);
        if (!type) return;
        for (const FieldDef& field : type->fields)
            if (!field.hidden && field.access != Access::initializeOnly)
                add(Proposal::Kind::field, field.name, fieldLine(field));
    }

    const DocumentWords &whole_, &before_;
    const WordsEnd& end_;
    const bool isXml_;
    std::vector<Proposal> all_;
};

bool isPartOfWord(char c) {
    return c > ' ' && !std::string_view("\"'<>{}[]()=,.;/").contains(c);
}

}  // namespace

int clauseOf(std::string_view component) {
    const auto* found = std::ranges::find(kComponents, component);
    return found == std::end(kComponents) ? 0 : static_cast<int>(found - std::begin(kComponents)) + 7;
}

Proposals proposalsAt(std::string_view text, std::size_t offset) {
    const std::string_view written = text.substr(0, offset);
    const DocumentWords before = wordsOf(written);
    Proposals result;
    result.replaced =
        before.end.begun.empty() ? TextRange{written.size(), written.size()} : rangeOf(text, before.end.begun);
    // A list of strings in XML: the last word counts, of other values the whole.
    result.all = Proposer(wordsOf(text), before, isXml(text)).take();
    return result;
}

std::optional<Explanation> explanationAt(std::string_view text, std::size_t offset) {
    const DocumentWords words = wordsOf(text);
    const Word* word = wordAt(words, text, offset);
    if (!word) return std::nullopt;
    const TextRange range = rangeOf(text, word->text);
    switch (word->kind) {
        case WordKind::nodeType:
            if (const NodeType* type = findBuiltinType(word->text); type && !type->internal)
                return Explanation{range, nodeText(*type)};
            [[fallthrough]];
        case WordKind::protoUse:
        case WordKind::proto:
            if (const WordProto* proto = protoOf(words, word->text)) return Explanation{range, protoText(*proto)};
            return std::nullopt;
        case WordKind::use:
        case WordKind::definition:
            if (const NodeType* type = typeOfName(words, word->text))
                return Explanation{range, fmt::format("DEF {}\n\n{}", word->text, nodeText(*type))};
            return std::nullopt;
        case WordKind::field:
        case WordKind::routeField: {
            const NodeType* type =
                word->kind == WordKind::field ? typeOf(words, word->parent) : typeOfName(words, word->field);
            const FieldDef* field = fieldOf(type, word->text);
            if (field && !field->hidden) return Explanation{range, fieldText(*type, *field)};
            const WordProto* proto =
                word->kind == WordKind::field ? protoOf(words, word->parent) : protoOfName(words, word->field);
            if (!proto) return std::nullopt;
            const auto declared = std::ranges::find(proto->fields, word->text, &WordProto::Field::name);
            if (declared == proto->fields.end()) return std::nullopt;
            return Explanation{range, fmt::format("```\n{}\n```\nOf PROTO {}\n", fieldLine(*declared), proto->name)};
        }
        default:
            return std::nullopt;
    }
}

std::optional<TextRange> definitionAt(std::string_view text, std::size_t offset) {
    const DocumentWords words = wordsOf(text);
    const Word* word = wordAt(words, text, offset);
    if (!word) return std::nullopt;
    std::string_view name = word->text;
    const bool isOfProto = word->kind == WordKind::nodeType || word->kind == WordKind::protoUse;
    if (word->kind == WordKind::routeField) name = word->field;
    if (!isOfProto && word->kind != WordKind::use && word->kind != WordKind::definition &&
        word->kind != WordKind::routeField)
        return std::nullopt;
    const WordKind wanted = isOfProto ? WordKind::proto : WordKind::definition;
    const Word* found = nullptr;
    for (const Word& one : words.words) {
        if (one.kind != wanted || one.text != name) continue;
        if (found && one.text.data() > word->text.data()) break;  // the last before it, or else the first
        found = &one;
    }
    return found ? std::optional(rangeOf(text, found->text)) : std::nullopt;
}

std::optional<Misspelled> misspelledWord(std::string_view text, std::size_t offset, std::string_view message) {
    constexpr std::string_view kMeant = " (did you mean ";
    constexpr std::size_t kFar = 4096;  // a message stands at the node of whose field it speaks
    const std::size_t at = message.find(kMeant);
    const std::size_t end = message.find("?)", at);
    if (at == message.npos || end == message.npos) return std::nullopt;
    const std::string_view meant = message.substr(at + kMeant.size(), end - at - kMeant.size());
    std::string_view wrong = message.substr(0, at);
    if (wrong.ends_with('\'')) {
        wrong.remove_suffix(1);
        wrong = wrong.substr(wrong.rfind('\'') + 1);
    } else {
        wrong = wrong.substr(wrong.rfind(' ') + 1);
    }
    if (wrong.empty() || meant.empty() || offset > text.size()) return std::nullopt;
    // For an attribute, the place is that of its value.
    const std::size_t last = text.substr(0, offset).find_last_not_of(" \t\r\n='\"");
    const std::string_view before = text.substr(0, last == text.npos ? 0 : last + 1);
    if (before.ends_with(wrong)) {
        const std::size_t begin = before.size() - wrong.size();
        if (begin == 0 || !isPartOfWord(before[begin - 1]))
            return Misspelled{{begin, before.size()}, std::string(meant)};
    }
    const std::string_view behind = text.substr(offset, kFar);
    for (std::size_t i = behind.find(wrong); i != behind.npos; i = behind.find(wrong, i + 1)) {
        const bool begins = i == 0 || !isPartOfWord(behind[i - 1]);
        const bool ends = i + wrong.size() == behind.size() || !isPartOfWord(behind[i + wrong.size()]);
        if (begins && ends) return Misspelled{{offset + i, offset + i + wrong.size()}, std::string(meant)};
    }
    return std::nullopt;
}

}  // namespace rtsg::editor
