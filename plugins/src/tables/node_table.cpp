// Reads a user's node table at run time, and makes node types of it.
#include "node_table.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>

#include <fmt/format.h>

#include <rtsg/core/spec_table.h>
#include <rtsg/plugins/extensions.h>

#include "spec_model.h"

namespace rtsg {

namespace {

/// A table is written by hand. Its types inherit from each other by recursion, which must end before the stack does.
constexpr std::size_t kMaxBytes = 1 << 20, kMaxTypes = 1000, kMaxFields = 4096;
constexpr int kMaxLevel = 255;

template <class Enum, std::size_t N>
Enum fromName(const std::array<std::string_view, N>& names, std::string_view name) {
    return static_cast<Enum>(std::ranges::find(names, name) - names.begin());  // the parser knows no others
}
constexpr std::array<std::string_view, 4> kAccess{"initializeOnly", "inputOnly", "outputOnly", "inputOutput"};
constexpr std::array<std::string_view, 9> kAspects{"none",  "structure", "transform", "geometry", "appearance",
                                                   "light", "view",      "sound",     "time"};
constexpr std::array<std::string_view, 10> kUnits{"none",  "length",      "angle",        "mass", "force",
                                                  "speed", "angularRate", "acceleration", "area", "torque"};
constexpr std::array<std::string_view, 4> kActs{"unstated", "never", "onInput", "always"};

std::string joined(const std::vector<std::string>& parts) {
    return fmt::format("{}", fmt::join(parts, "|"));
}

SpecField rowOf(const spec::Field& field) {
    SpecField row{};
    row.name = field.name;
    row.defaultText = field.defaultText;
    row.allowed = field.allowed;
    row.accepts = field.accepts;
    row.min = field.min;
    row.max = field.max;
    row.custom = field.custom;
    if (field.custom.empty())
        fieldTypeFromName(field.type, row.type);
    else
        row.type = field.type.starts_with('M') ? FieldType::MFCustom : FieldType::SFCustom;
    row.access = fromName<Access>(kAccess, field.access);
    row.aspect = fromName<Aspect>(kAspects, field.aspect);
    row.exclusiveMin = field.exclusiveMin;
    row.exclusiveMax = field.exclusiveMax;
    row.hidden = field.hidden;
    row.unit = field.unit.empty() ? Unit::none : fromName<Unit>(kUnits, field.unit);
    row.since = static_cast<std::uint8_t>(field.since);
    return row;
}

/// By way of the static form of a table, as compiled tables come.
std::unique_ptr<NodeType> makeType(const spec::Type& type) {
    std::vector<SpecField> fields;
    std::vector<std::uint16_t> list;
    for (const spec::Field& field : type.fields) {
        list.push_back(static_cast<std::uint16_t>(fields.size()));
        fields.push_back(rowOf(field));
    }
    const std::string implements = joined(type.implements), below = joined(type.all.below);
    SpecNode node{};
    node.name = type.name;
    node.component = type.component;
    node.containerField = type.container;
    node.implements = implements;
    node.fieldCount = static_cast<std::uint16_t>(fields.size());
    node.level = static_cast<std::uint8_t>(type.level);
    node.internal = type.hidden;
    node.since = static_cast<std::uint8_t>(type.since);
    const std::string_view acts = type.all.acts.empty() ? "never" : std::string_view(type.all.acts);
    node.tags = {fromName<Acts>(kActs, acts), type.all.writesInputs, type.all.role, below};
    const SpecTable table{fields, list, {&node, 1}, {}, {}};
    return std::move(makeNodeTypes(table, NodeType::Kind::user).front());
}

/// Refuses types that can be compiled but are too large here.
void checkSize(const spec::Type& type, spec::Model& model) {
    if (type.level > kMaxLevel) model.error(type.where, fmt::format("a level is at most {}", kMaxLevel));
    if (type.fields.size() > kMaxFields)
        model.error(type.where, fmt::format("'{}' has more than {} fields", type.name, kMaxFields));
}

}  // namespace

bool readNodeTable(std::string_view text, Extensions& extensions, Diagnostics& diagnostics) {
    if (text.size() > kMaxBytes) {
        diagnostics.error({}, fmt::format("a node table of more than {} bytes is not read", kMaxBytes));
        return false;
    }
    spec::Model model([&](const spec::Position& where, const std::string& what) {
        diagnostics.error({static_cast<std::uint32_t>(where.line), 0}, what);
    });
    for (const detail::TableText& table : detail::standardTables())
        model.parse(std::string(table.name), std::string(table.text), true);
    const std::size_t before = model.types().size();
    model.parse(diagnostics.file(), std::string(text), false);
    if (model.types().size() - before > kMaxTypes)
        model.error({diagnostics.file(), 1}, fmt::format("a node table has at most {} types", kMaxTypes));
    if (model.errors() == 0) model.resolve();
    for (const spec::Type& type : model.types())
        if (!type.imported) checkSize(type, model);
    if (model.errors() > 0) return false;
    Extensions more = extensions;
    const auto fieldTypes = fieldTypeRegistry();
    const auto refuse = [&](int line, const Diagnostic& why) {
        diagnostics.error({static_cast<std::uint32_t>(line), 0}, why.text);
        restoreFieldTypes(fieldTypes);
        return false;
    };
    for (const auto& [name, declared] : model.fieldTypes())
        if (const auto created = fieldTypeOf(declared.text); !created) return refuse(declared.line, created.error());
    for (const spec::Type& type : model.types()) {
        if (type.imported || type.isAbstract) continue;
        if (auto ok = more.add(std::shared_ptr<const NodeType>(makeType(type))); !ok)
            return refuse(type.where.line, ok.error());
    }
    extensions = std::move(more);
    return true;
}

bool loadNodeTable(const std::filesystem::path& file, Extensions& extensions, Diagnostics& diagnostics) {
    diagnostics.setFile(file.string());
    std::ifstream in(file, std::ios::binary);
    std::string text(kMaxBytes + 1, '\0');
    if (in) in.read(text.data(), static_cast<std::streamsize>(text.size()));
    if (in.bad() || (!in && in.gcount() == 0 && !in.eof())) {
        diagnostics.error({}, std::string("cannot read it: ") + std::strerror(errno), DiagnosticCode("file"));
        return false;
    }
    text.resize(static_cast<std::size_t>(in.gcount()));
    return readNodeTable(text, extensions, diagnostics);
}

}  // namespace rtsg
