// Reads node tables line by line: heads of types with their tags, fields with default, constraint and aspect.
#include <algorithm>
#include <charconv>
#include <cmath>
#include <iostream>
#include <numbers>
#include <sstream>

#include "spec_model.h"

namespace spec {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct TypeInfo {
    std::string_view name, cpp;
    int components;
};
constexpr TypeInfo kTypes[] = {
    {"Bool", "bool", 1},
    {"Int32", "std::int32_t", 1},
    {"Float", "float", 1},
    {"Double", "double", 1},
    {"Time", "::rtsg::Time", 1},
    {"String", "::rtsg::String", 0},
    {"Node", "::rtsg::NodeId", 0},
    {"Color", "::rtsg::Color", 3},
    {"ColorRGBA", "::rtsg::ColorRGBA", 4},
    {"Image", "::rtsg::Image", 0},
    {"Vec2f", "::rtsg::Vec2f", 2},
    {"Vec2d", "::rtsg::Vec2d", 2},
    {"Vec3f", "::rtsg::Vec3f", 3},
    {"Vec3d", "::rtsg::Vec3d", 3},
    {"Vec4f", "::rtsg::Vec4f", 4},
    {"Vec4d", "::rtsg::Vec4d", 4},
    {"Rotation", "::rtsg::Rotation", 4},
    {"Matrix3f", "::rtsg::Matrix3f", 9},
    {"Matrix3d", "::rtsg::Matrix3d", 9},
    {"Matrix4f", "::rtsg::Matrix4f", 16},
    {"Matrix4d", "::rtsg::Matrix4d", 16},
    {"Custom", "::rtsg::CustomValue", 0},
};
constexpr std::string_view kAspects[] = {"none",  "structure", "transform", "geometry", "appearance",
                                         "light", "view",      "sound",     "time"};
constexpr std::string_view kAspectList = "@none @structure @transform @geometry @appearance @light @view @sound @time";

constexpr std::string_view kUnits[] = {"none",  "length",      "angle",        "mass", "force",
                                       "speed", "angularRate", "acceleration", "area", "torque"};
constexpr std::string_view kVersions[] = {"2.0", "3.0", "3.1", "3.2", "3.3", "4.0", "4.1"};
constexpr std::string_view kActs[] = {"never", "onInput", "always"};
struct RoleInfo {
    std::string_view name;
    bool hasNodesBelow;
};
constexpr RoleInfo kRoles[] = {
    {"none", false},       {"group", true},       {"choice", true},     {"level", true},     {"layers", true},
    {"humanoid", true},    {"joint", true},       {"shape", false},     {"light", false},    {"view", false},
    {"background", false}, {"fog", false},        {"sound", false},     {"sensor", false},   {"listener", false},
    {"clipPlane", false},  {"navigation", false}, {"displacer", false}, {"localFog", false},
};

const TypeInfo* typeInfo(std::string_view type) {
    if (!type.starts_with("SF") && !type.starts_with("MF")) return nullptr;
    const auto found = std::ranges::find(kTypes, type.substr(2), &TypeInfo::name);
    return found == std::end(kTypes) ? nullptr : &*found;
}

bool isMF(const Field& field) {
    return field.type.starts_with("MF");
}
bool isNode(const Field& field) {
    return field.type.substr(2) == "Node";
}
bool isString(const Field& field) {
    return field.type.substr(2) == "String";
}
bool isCustom(const Field& field) {
    return !field.custom.empty();
}
bool isInteger(const Field& field) {
    return field.type.substr(2) == "Int32" || field.type.substr(2) == "Image" || field.custom.contains(" int32 ") ||
           field.custom.contains(" bytes ");
}
std::string shown(const Field& field) {
    return isCustom(field) ? field.type.substr(0, 2) + field.custom.substr(0, field.custom.find(' ')) : field.type;
}
/// How many numbers an element has; 0: bytes, of which each value has as many as it wants.
std::size_t numbersIn(const Field& field) {
    if (!isCustom(field)) return static_cast<std::size_t>(std::max(componentsOf(field.type), 1));
    return static_cast<std::size_t>(std::stoi(field.custom.substr(field.custom.rfind(' ') + 1)));
}

bool isIdentifier(std::string_view text) {
    if (text.empty() || (text[0] >= '0' && text[0] <= '9')) return false;
    return std::ranges::all_of(text, [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
    });
}

/// Decimal, `inf`, or a multiple of pi as in `-pi`, `2pi`, `pi/2`.
bool parseNumber(std::string_view text, double& out) {
    const bool negative = text.starts_with('-');
    if (negative) text.remove_prefix(1);
    if (text == "inf") {
        out = kInfinity;
    } else if (const auto pi = text.find("pi"); pi != std::string_view::npos) {
        double factor = 1, divisor = 1;
        if (pi > 0 && !parseNumber(text.substr(0, pi), factor)) return false;
        const std::string_view rest = text.substr(pi + 2);
        if (!rest.empty() && (rest[0] != '/' || !parseNumber(rest.substr(1), divisor))) return false;
        out = std::numbers::pi * factor / divisor;
    } else {
        const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), out);
        if (code != std::errc() || end != text.data() + text.size()) return false;
    }
    if (negative) out = -out;
    return true;
}

std::vector<std::string_view> split(std::string_view text, char separator) {
    std::vector<std::string_view> parts;
    for (;;) {
        const auto end = text.find(separator);
        std::string_view part = text.substr(0, end);
        while (!part.empty() && part.front() == ' ') part.remove_prefix(1);
        while (!part.empty() && part.back() == ' ') part.remove_suffix(1);
        parts.push_back(part);
        if (end == std::string_view::npos) return parts;
        text.remove_prefix(end + 1);
    }
}

}  // namespace

int componentsOf(std::string_view type) {
    const TypeInfo* info = typeInfo(type);
    return info ? info->components : -1;
}

std::string cppType(std::string_view type) {
    const std::string element(typeInfo(type)->cpp);
    return type.starts_with("MF") ? "::rtsg::Array<" + element + ">" : element;
}

struct Model::Token {
    enum Kind { word, quoted, group } kind;
    std::string text;  // without the quotes; with the brackets
};

void Model::error(const Position& where, const std::string& text) {
    ++errors_;
    if (parsing_ && errorLine_ == where.line) return;
    errorLine_ = where.line;
    if (report_) return report_(where, text);
    std::cerr << where.file << ':' << where.line << ": error: " << text << '\n';
}

const Type* Model::find(std::string_view name) const {
    const auto found = byName_.find(name);
    return found == byName_.end() ? nullptr : &types_[found->second];
}

Type* Model::lookup(std::string_view name) {
    return const_cast<Type*>(find(name));
}

std::vector<Model::Token> Model::tokens(const Position& where, std::string_view line) {
    std::vector<Token> result;
    std::size_t i = 0;
    const auto quotedEnd = [&](std::size_t from) {  // index of the closing quote, or the end of the line
        for (++from; from < line.size() && line[from] != '"'; ++from) {
        }
        return from;
    };
    while (i < line.size()) {
        const char c = line[i];
        if (c == ' ' || c == '\t' || c == '\r' || c == '\n') {
            ++i;
        } else if (c == '"') {
            const std::size_t end = quotedEnd(i);
            if (end == line.size()) {
                error(where, "a string is not closed");
                return result;
            }
            result.push_back({Token::quoted, std::string(line.substr(i + 1, end - i - 1))});
            i = end + 1;
        } else if (c == '[' || c == '(') {
            std::size_t end = i + 1;
            while (end < line.size() && line[end] != ']' && line[end] != ')')
                end = line[end] == '"' ? std::min(quotedEnd(end) + 1, line.size()) : end + 1;
            if (end == line.size()) {
                error(where, "a bracket is not closed");
                return result;
            }
            result.push_back({Token::group, std::string(line.substr(i, end - i + 1))});
            i = end + 1;
        } else if (c == ',' || c == ':') {
            result.push_back({Token::word, std::string(1, c)});
            ++i;
        } else {
            std::size_t end = i;
            while (end < line.size() && !std::string_view(" \t\r\n,:[(\"").contains(line[end])) ++end;
            result.push_back({Token::word, std::string(line.substr(i, end - i))});
            i = end;
        }
    }
    return result;
}

void Model::parse(const std::string& file, const std::string& text, bool imported) {
    component_.clear();
    parsing_ = true;
    errorLine_ = 0;
    open_ = nullptr;
    openType_ = nullptr;
    std::istringstream lines(text);
    std::string line;
    Position where{file, 0};
    for (int number = 1; std::getline(lines, line); ++number) {
        where.line = number;
        // A line that ends in `|` or `,` goes on in the next.
        std::string more;
        const auto strip = [](std::string& s) {
            bool inString = false;
            for (std::size_t i = 0; i < s.size(); ++i) {
                if (s[i] == '"') inString = !inString;
                if (s[i] == '#' && !inString) s.resize(i);
            }
            s.resize(s.find_last_not_of(" \t\r") + 1);
        };
        strip(line);
        while ((line.ends_with('|') || line.ends_with(',')) && std::getline(lines, more)) {
            ++number;
            strip(more);
            line += more;
        }
        const std::vector<Token> found = tokens(where, line);
        if (found.empty()) continue;
        if (isFieldType(found[0].text) || found[0].text == "retag")
            parseField(where, found);
        else if (found[0].text == "fieldType")
            parseFieldType(where, found);
        else
            parseHead(where, found, imported);
    }
    parsing_ = false;
}

void Model::parseHead(const Position& where, const std::vector<Token>& found, bool imported) {
    std::size_t next = 0;
    const auto word = [&] { return next < found.size() ? found[next].text : std::string(); };
    const std::string keyword = word();
    ++next;
    const std::string name = word();
    ++next;
    open_ = nullptr;
    openType_ = nullptr;
    if (keyword == "component") {
        component_ = name;
        if (!isIdentifier(name) || next < found.size()) error(where, "expected `component Name`");
        return;
    }
    if (keyword == "extend") {
        extensions_.push_back({where, name, {}, imported});
        open_ = &extensions_.back().own;
        if (next < found.size()) error(where, "expected `extend Name`");
        return;
    }
    Type type;
    type.where = where;
    type.name = name;
    type.component = component_;
    type.imported = imported;
    if (keyword == "abstract")
        type.isAbstract = true;
    else if (keyword == "internal")
        type.hidden = true;
    else if (keyword != "node")
        return error(where,
                     "expected component, abstract, node, internal, extend, retag, fieldType or a field type, not '" +
                         keyword + "'");
    if (!isIdentifier(name)) return error(where, "'" + name + "' cannot name a type");
    if (component_.empty()) error(where, "no `component` line before '" + name + "'");
    bool hasLevel = false;
    while (next < found.size()) {
        const std::string item = word();
        ++next;
        if (item == ":" || item == ",") {
            type.bases.push_back(word());
            ++next;
        } else if (item == "level") {
            const std::string text = word();
            ++next;
            const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), type.level);
            hasLevel = code == std::errc() && end == text.data() + text.size() && type.level >= 1;
            if (!hasLevel) error(where, "'" + text + "' is no level");
        } else if (item == "container") {
            type.container = word();
            ++next;
        } else if (item.starts_with('@')) {
            --next;
            parseTag(type, found, next);
        } else {
            error(where, "unexpected '" + item + "'");
        }
    }
    if (!type.isAbstract && !type.hidden) {
        if (!hasLevel) error(where, "node '" + name + "' has no level");
        if (type.container.empty()) error(where, "node '" + name + "' has no container field");
    }
    if (const Type* other = find(name))
        return error(where, "'" + name + "' is already defined at " + other->where.file + ':' +
                                std::to_string(other->where.line));
    byName_[name] = types_.size();
    types_.push_back(std::move(type));
    open_ = &types_.back().own;
    openType_ = &types_.back();
}

/// `@acts(WHEN)`, `@writesInputs`, `@role(NAME FIELD...)` or `@since(VERSION)`.
void Model::parseTag(Type& type, const std::vector<Token>& found, std::size_t& next) {
    const std::string tag = found[next++].text;
    std::vector<std::string> words;
    if (next < found.size() && found[next].kind == Token::group && found[next].text.front() == '(') {
        const std::string& group = found[next++].text;
        for (const Token& token : tokens(type.where, std::string_view(group).substr(1, group.size() - 2)))
            words.push_back(token.text);
    }
    if (tag == "@writesInputs" && words.empty()) {
        type.tags.writesInputs = true;
    } else if (tag == "@acts") {
        if (words.size() != 1 || std::ranges::find(kActs, words[0]) == std::end(kActs))
            return error(type.where, "expected @acts(never), @acts(onInput) or @acts(always)");
        type.tags.acts = words[0];
    } else if (tag == "@role") {
        const auto role = words.empty() ? std::end(kRoles) : std::ranges::find(kRoles, words[0], &RoleInfo::name);
        if (role == std::end(kRoles))
            return error(type.where, words.empty() ? "@role names no role" : "'" + words[0] + "' is no role");
        if (role->hasNodesBelow != (words.size() > 1))
            return error(type.where, "role '" + words[0] + (role->hasNodesBelow ? "' needs" : "' takes no") +
                                         " fields whose nodes hang below");
        type.tags.role = words[0];
        type.tags.below.assign(words.begin() + 1, words.end());
    } else if (tag == "@since") {
        if (type.isAbstract) return error(type.where, "@since is of nodes and fields");
        parseSince(type.where, words.size() == 1 ? words[0] : std::string(), type.since);
    } else {
        error(type.where, "'" + tag + "' is no tag of a type; one of @acts @writesInputs @role @since");
    }
}

/// Takes the tags off the end of a line: one aspect, `@unit(U)` and `@since(V)`, in any order.
bool Model::parseFieldTags(const Position& where, std::vector<Token>& found, FieldTags& tags) {
    const auto first = std::ranges::find_if(
        found, [](const Token& token) { return token.kind == Token::word && token.text.starts_with('@'); });
    for (auto tag = first; tag != found.end(); ++tag) {
        const std::string name = tag->text;
        std::string inside;
        if (tag + 1 != found.end() && tag[1].kind == Token::group) {
            ++tag;
            inside = tag->text.substr(1, tag->text.size() - 2);
        }
        if (name == "@since") {
            if (!parseSince(where, inside, tags.since)) return false;
        } else if (name == "@unit") {
            if (std::ranges::find(kUnits, inside) == std::end(kUnits))
                return error(where, "'" + inside + "' is no unit"), false;
            tags.unit = inside;
        } else if (inside.empty() && std::ranges::find(kAspects, name.substr(1)) != std::end(kAspects) &&
                   tags.aspect.empty()) {
            tags.aspect = name.substr(1);
        } else {
            return error(where, "'" + name + "' is no tag of a field; one aspect (" + std::string(kAspectList) +
                                    "), @unit(U), @since(V)"),
                   false;
        }
    }
    found.erase(first, found.end());
    return true;
}

bool Model::parseSince(const Position& where, const std::string& version, int& since) {
    if (std::ranges::find(kVersions, version) == std::end(kVersions))
        return error(where, "'" + version + "' is no version; one of 2.0 (VRML97) 3.0 3.1 3.2 3.3 4.0 4.1"), false;
    since = (version[0] - '0') * 10 + (version[2] - '0');
    return true;
}

/// Only measured quantities have units: a rotation's angle is recognised as one, and other types have none.
void Model::checkUnit(const Position& where, const Field& field) {
    constexpr std::string_view measured[] = {"Float", "Double", "Vec2f", "Vec2d", "Vec3f", "Vec3d", "Vec4f", "Vec4d"};
    if (!field.unit.empty() && std::ranges::find(measured, field.type.substr(2)) == std::end(measured))
        error(where, "values of " + shown(field) + " have no unit");
}

bool Model::isFieldType(const std::string& name) const {
    if (componentsOf(name) >= 0) return name.substr(2) != "Custom";
    return (name.starts_with("SF") || name.starts_with("MF")) && fieldTypes_.contains(name.substr(2));
}

/// `fieldType SFQuantity float64 2`
void Model::parseFieldType(const Position& where, const std::vector<Token>& found) {
    constexpr std::size_t kLongestName = 64;
    constexpr int kMax = 1024;
    constexpr std::string_view kinds[] = {"float64", "float32", "int32", "bytes"};
    const auto word = [&](std::size_t i) { return i < found.size() ? found[i].text : std::string(); };
    const std::string name = word(1).starts_with("SF") ? word(1).substr(2) : std::string();
    if (!isIdentifier(name) || name[0] < 'A' || name[0] > 'Z' || name.size() > kLongestName ||
        componentsOf("SF" + name) >= 0)
        return error(where, "'" + word(1) + "' cannot name a field type of one's own: it is SF and a word of its own");
    int count = -1;
    const std::string number = word(3);
    const auto [end, code] = std::from_chars(number.data(), number.data() + number.size(), count);
    const bool isCount = code == std::errc() && end == number.data() + number.size() && count <= kMax &&
                         count >= (word(2) == "bytes" ? 0 : 1);
    if (found.size() != 4 || std::ranges::find(kinds, word(2)) == std::end(kinds) || !isCount)
        return error(where,
                     "expected `fieldType SFName KIND COUNT`: float64, float32 or int32 and 1 to 1024, or "
                     "bytes and 0 to 1024, where 0 is any number");
    const std::string text = name + ' ' + word(2) + ' ' + std::to_string(count);
    if (const auto [known, isNew] = fieldTypes_.emplace(name, FieldTypeLine{text, where.line});
        !isNew && known->second.text != text)
        return error(where, "there is a field type SF" + name + " already, which is " + known->second.text);
}

void Model::parseField(const Position& where, const std::vector<Token>& line) {
    std::vector<Token> found = line;
    const bool isRetag = found[0].text == "retag";
    FieldTags tags;
    if (!parseFieldTags(where, found, tags)) return;
    if (isRetag) {
        if (!openType_) return error(where, "retag stands outside of a type");
        if (tags.aspect.empty() && tags.unit.empty() && tags.since == 0)
            return error(where, "retag ends in no tag: an aspect, @unit(U) or @since(V)");
        Retag retag{where, {}, tags};
        for (std::size_t i = 1; i < found.size(); ++i) retag.fields.push_back(found[i].text);
        openType_->retags.push_back(std::move(retag));
        return;
    }
    if (tags.aspect.empty()) {
        const std::string what = found.size() < 3 ? "this line" : "field '" + found[2].text + "'";
        return error(where, what + " must have an aspect, one of " + std::string(kAspectList));
    }
    if (!open_) return error(where, "this field stands outside of a type");
    if (found.size() < 3) return error(where, "expected TYPE ACCESS NAME [DEFAULT] [RANGE] @ASPECT");
    Field field;
    field.where = where;
    field.type = found[0].text;
    if (const auto own = fieldTypes_.find(std::string_view(field.type).substr(2)); own != fieldTypes_.end()) {
        field.custom = own->second.text;
        field.type = field.type.substr(0, 2) + "Custom";
    }
    field.name = found[2].text;
    field.aspect = tags.aspect;
    field.unit = tags.unit;
    field.since = tags.since;
    const std::string& access = found[1].text;
    if (access == "[]")
        field.access = "initializeOnly";
    else if (access == "[in]")
        field.access = "inputOnly";
    else if (access == "[out]")
        field.access = "outputOnly";
    else if (access == "[in,out]")
        field.access = "inputOutput";
    else if (access == "hidden")
        field.access = "inputOutput", field.hidden = true;
    else
        return error(where, "'" + access + "' is no access; one of [] [in] [out] [in,out] hidden");
    if (!isIdentifier(field.name)) return error(where, "'" + field.name + "' cannot name a field");

    std::size_t next = 3;
    if (field.access == "initializeOnly" || field.access == "inputOutput") parseDefault(field, found, next);
    for (; next < found.size(); ++next) {
        if (found[next].kind != Token::group)
            return error(where, "unexpected '" + found[next].text + "' in field '" + field.name + "'");
        parseGroup(field, found[next].text);
    }
    checkDefault(field);
    checkUnit(where, field);
    for (const Field& other : *open_)
        if (other.name == field.name) return error(where, "field '" + field.name + "' is listed twice");
    open_->push_back(std::move(field));
}

void Model::parseDefault(Field& field, const std::vector<Token>& found, std::size_t& next) {
    std::vector<Token> values;
    if (isMF(field)) {
        if (next >= found.size() || found[next].kind != Token::group || found[next].text[0] != '[')
            return error(field.where, "field '" + field.name + "' needs a default in brackets");
        const std::string& group = found[next++].text;
        values = tokens(field.where, std::string_view(group).substr(1, group.size() - 2));
    } else {
        while (next < found.size() && found[next].kind != Token::group) values.push_back(found[next++]);
    }
    std::size_t count = 0;
    for (const Token& value : values) {
        double number = 0;
        if (value.text == "," && value.kind == Token::word) continue;
        ++count;
        if (isString(field)) {
            if (value.kind != Token::quoted) return error(field.where, "expected a string, not '" + value.text + "'");
            field.defaultText += value.text + '\n';
        } else if (isNode(field)) {
            if (isMF(field) || value.text != "NULL") return error(field.where, "nodes default to NULL or []");
        } else if (field.type.substr(2) == "Bool") {
            if (value.text != "TRUE" && value.text != "FALSE")
                return error(field.where, "expected TRUE or FALSE, not '" + value.text + "'");
            field.defaultText += value.text + ' ';
        } else {
            if (value.kind != Token::word || !parseNumber(value.text, number) || std::isinf(number) ||
                (isInteger(field) && (number != std::trunc(number) || std::abs(number) > 2147483647.0)))
                return error(field.where, "'" + value.text + "' is no value of " + shown(field));
            // Keep the number as written if possible: the reader of the table rounds once, to the type of the field.
            if (isInteger(field)) {
                field.defaultText += std::to_string(static_cast<long long>(number)) + ' ';
            } else if (value.text.contains("pi")) {
                char digits[32];
                const auto end = std::to_chars(digits, digits + sizeof(digits), number).ptr;
                field.defaultText += std::string(digits, end) + ' ';
            } else {
                field.defaultText += value.text + ' ';
            }
        }
    }
    if (!field.defaultText.empty() && field.defaultText.back() == ' ') field.defaultText.pop_back();
    const std::size_t components = numbersIn(field);
    if (components == 0) {
        if (isMF(field) && count > 0) error(field.where, "lists of bytes default to []");
    } else if (field.type == "SFImage") {
        if (count != 3) error(field.where, "an image defaults to three numbers, 0 0 0");
    } else if (isMF(field) ? count % components != 0 : count != components) {
        error(field.where, "the default of '" + field.name + "' has " + std::to_string(count) + " values, " +
                               shown(field) + " takes " + (isMF(field) ? "a multiple of " : "") +
                               std::to_string(components));
    }
}

void Model::parseGroup(Field& field, const std::string& group) {
    const std::string_view inside = std::string_view(group).substr(1, group.size() - 2);
    const std::vector<std::string_view> choices = split(inside, '|');
    if (isNode(field)) {
        for (const std::string_view name : choices) {
            if (!isIdentifier(name)) return error(field.where, "'" + std::string(name) + "' cannot name a type");
            if (!field.accepts.empty()) field.accepts += '|';
            field.accepts += name;
        }
    } else if (isString(field)) {
        for (const std::string_view choice : choices) {
            if (choice.size() < 2 || choice.front() != '"' || choice.back() != '"')
                return error(field.where, "expected strings between | in " + group);
            field.allowed += std::string(choice.substr(1, choice.size() - 2)) + '\n';
        }
    } else if (isCustom(field)) {
        error(field.where, "values of " + shown(field) + " have no range");
    } else {
        const std::vector<std::string_view> bounds = split(inside, ',');
        if (bounds.size() != 2 || !parseNumber(bounds[0], field.min) || !parseNumber(bounds[1], field.max) ||
            field.min > field.max)
            return error(field.where, "'" + group + "' is no range");
        field.exclusiveMin = group.front() == '(' && !std::isinf(field.min);
        field.exclusiveMax = group.back() == ')' && !std::isinf(field.max);
    }
}

void Model::checkDefault(const Field& field) {
    if (isString(field) && !field.allowed.empty()) {
        std::istringstream values(field.defaultText);
        for (std::string value; std::getline(values, value);)
            if (!("\n" + field.allowed).contains("\n" + value + "\n"))
                error(field.where, "the default \"" + value + "\" is not among the allowed strings");
    }
    if (componentsOf(field.type) == 0 || field.type.substr(2) == "Bool") return;
    std::istringstream values(field.defaultText);
    // Bounds that are no integers are multiples of pi, and files and tables write those in decimals.
    const auto slack = [](double bound) { return bound == std::trunc(bound) ? 0.0 : std::abs(bound) * 1e-3; };
    for (double value; values >> value;) {
        if (value < field.min - slack(field.min) || (field.exclusiveMin && value == field.min) ||
            value > field.max + slack(field.max) || (field.exclusiveMax && value == field.max))
            error(field.where, "the default of '" + field.name + "' is outside of its range");
    }
}

}  // namespace spec
