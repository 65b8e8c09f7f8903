// Records document commands, and gives them to another handler.
#include <rtsg/documents/command_list.h>

#include <algorithm>
#include <cstring>
#include <utility>

namespace rtsg {

namespace {

std::size_t bytesOfArray(std::size_t bytes) {
    return bytes == 0 ? bytes : sizeof(detail::ArrayHeader) + bytes + detail::kArrayPadding;
}
std::size_t bytesOf(std::string_view text) {
    return bytesOfArray(text.size());
}
/// Memory behind a value: its elements, and those of each string.
std::size_t bytesOf(const Value& value) {
    if (value.holds<String>()) return bytesOf(value.as<String>().view());
    if (value.holds<Image>()) return bytesOfArray(value.as<Image>().words.size() * sizeof(std::int32_t));
    if (value.holds<Array<String>>()) {
        const auto& all = value.as<Array<String>>();
        std::size_t bytes = bytesOfArray(all.size() * sizeof(String));
        for (const String& one : all) bytes += bytesOf(one.view());
        return bytes;
    }
    if (value.holds<Array<Image>>()) {
        std::size_t bytes = 0;
        for (const Image& one : value.as<Array<Image>>())
            bytes += bytesOfArray(one.words.size() * sizeof(std::int32_t)) + sizeof(Image);
        return bytes;
    }
    if (value.holds<Array<CustomValue>>()) {
        std::size_t bytes = 0;
        for (const CustomValue& one : value.as<Array<CustomValue>>())
            bytes += bytesOfArray(one.box.size()) + sizeof(CustomValue);
        return bytes;
    }
    if (!info(value.type()).shared) return 0;
    const detail::ArrayHeader* header = nullptr;
    std::memcpy(static_cast<void*>(&header), value.storage(), sizeof(header));
    return header ? bytesOfArray(header->size * header->elementSize) : 0;
}

}  // namespace

bool CommandList::take(std::size_t bytes, SourceLocation where) {
    bytes_ += bytes;
    if (!isFull_ && (bytes_ > limits_.bytes || nodes_ > limits_.nodes)) {
        isFull_ = true;
        fullOfNodes_ = nodes_ > limits_.nodes;
        fullAt_ = where;
    }
    return !isFull_;
}

CommandList::Command& CommandList::add(Kind kind, SourceLocation where, std::initializer_list<std::string_view> names) {
    const bool isTaken = take(sizeof(Command), where);
    Command& command = isTaken ? commands_.emplace_back() : dropped_ = {};
    command.kind = kind;
    command.where = where;
    std::ranges::transform(names, command.names, [&](std::string_view name) { return shared(name); });
    return command;
}

String CommandList::shared(std::string_view text) {
    if (text.empty()) return {};
    const auto found = shared_.find(text);
    if (found != shared_.end()) return found->second;
    if (isFull_) return {};
    constexpr std::size_t kEntry = 64;  // of the table
    bytes_ += kEntry + bytesOf(text);
    String copy(text);
    shared_.emplace(copy.view(), copy);
    return copy;
}

void CommandList::beginDocument(const DocumentHeader& header) {
    if (isFull_) return;
    add(Kind::beginDocument, {}).index = static_cast<std::uint32_t>(headers_.size());
    headers_.push_back(header);
}

void CommandList::endDocument() {
    add(Kind::endDocument, {});
}

void CommandList::component(std::string_view name, int level, SourceLocation where) {
    Command& command = add(Kind::component, where);
    command.names[0] = String(name);
    command.index = static_cast<std::uint32_t>(level);
}

void CommandList::meta(std::string_view name, std::string_view content, SourceLocation where) {
    if (!take(bytesOf(name) + bytesOf(content), where)) return;
    Command& command = add(Kind::meta, where);
    command.names[0] = String(name);
    command.names[1] = String(content);
}

void CommandList::unit(std::string_view category, std::string_view name, double conversionFactor,
                       SourceLocation where) {
    Command& command = add(Kind::unit, where);
    command.names[0] = String(category);
    command.names[1] = String(name);
    command.value = Value(conversionFactor);
}

void CommandList::beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation where) {
    ++nodes_;
    if (!take(bytesOf(def), where)) return;
    Command& command = add(Kind::beginNode, where);
    command.names[0] = shared(type);
    command.names[1] = String(def);
    command.names[2] = shared(field);
}

void CommandList::endNode(SourceLocation where) {
    add(Kind::endNode, where);
}

void CommandList::useNode(std::string_view def, std::string_view field, SourceLocation where) {
    add(Kind::useNode, where, {def, field});
}

void CommandList::setField(std::string_view name, Value value, SourceLocation where) {
    if (!take(bytesOf(value), where)) return;
    add(Kind::setField, where, {name}).value = std::move(value);
}

void CommandList::declareField(const FieldDeclaration& field, std::optional<Value> value, SourceLocation where) {
    if (value && !take(bytesOf(*value), where)) return;
    Command& command = add(Kind::declareField, where);
    command.names[0] = shared(field.name);
    command.access = field.access;
    command.type = field.type;
    if (field.custom)
        command.names[1] = String(std::string_view(field.custom->zero().box.data(), field.custom->zero().box.size()));
    command.hasValue = value.has_value();
    if (value) command.value = *std::move(value);
    if (!field.about || !take(bytesOf(field.about->appinfo) + bytesOf(field.about->documentation), where)) return;
    documentations_.push_back(field.about);
    command.index = static_cast<std::uint32_t>(documentations_.size());
}

void CommandList::isConnection(std::string_view nodeField, std::string_view protoField, SourceLocation where) {
    add(Kind::isConnection, where, {nodeField, protoField});
}

void CommandList::beginProto(std::string_view name, SourceLocation where) {
    add(Kind::beginProto, where, {name});
}

void CommandList::beginProtoBody(SourceLocation where) {
    add(Kind::beginProtoBody, where);
}

void CommandList::endProto(SourceLocation where) {
    add(Kind::endProto, where);
}

void CommandList::externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                              const std::vector<std::string>& url, SourceLocation where) {
    std::size_t bytes = fields.size() * sizeof(FieldDeclaration) + url.size() * sizeof(std::string);
    for (const FieldDeclaration& field : fields) bytes += bytesOf(field.name);
    for (const std::string& one : url) bytes += bytesOf(one);
    if (!take(bytes, where)) return;
    add(Kind::externProto, where, {name}).index = static_cast<std::uint32_t>(externs_.size());
    externs_.push_back({fields, url});
}

void CommandList::route(std::string_view fromNode, std::string_view fromField, std::string_view toNode,
                        std::string_view toField, SourceLocation where) {
    add(Kind::route, where, {fromNode, fromField, toNode, toField});
}

void CommandList::importNode(std::string_view inlineDef, std::string_view exportedName, std::string_view localName,
                             SourceLocation where) {
    add(Kind::importNode, where, {inlineDef, exportedName, localName});
}

void CommandList::exportNode(std::string_view localName, std::string_view exportedName, SourceLocation where) {
    add(Kind::exportNode, where, {localName, exportedName});
}

void CommandList::comment(std::string_view text, SourceLocation where) {
    if (!take(bytesOf(text), where)) return;
    add(Kind::comment, where).names[0] = String(text);
}

void CommandList::documentation(const Documentation& about, SourceLocation where) {
    if (!take(bytesOf(about.appinfo) + bytesOf(about.documentation), where)) return;
    add(Kind::documentation, where).index = static_cast<std::uint32_t>(documentations_.size());
    documentations_.push_back(std::make_shared<const Documentation>(about));
}

void CommandList::replay(DocumentHandler& handler) const {
    for (const Command& c : commands_) {
        const auto& name = c.names;
        switch (c.kind) {
            case Kind::beginDocument:
                handler.beginDocument(headers_[c.index]);
                break;
            case Kind::endDocument:
                handler.endDocument();
                break;
            case Kind::component:
                handler.component(name[0], static_cast<int>(c.index), c.where);
                break;
            case Kind::meta:
                handler.meta(name[0], name[1], c.where);
                break;
            case Kind::unit:
                handler.unit(name[0], name[1], c.value.as<double>(), c.where);
                break;
            case Kind::beginNode:
                handler.beginNode(name[0], name[1], name[2], c.where);
                break;
            case Kind::endNode:
                handler.endNode(c.where);
                break;
            case Kind::useNode:
                handler.useNode(name[0], name[1], c.where);
                break;
            case Kind::setField:
                handler.setField(name[0], c.value, c.where);
                break;
            case Kind::declareField:
                handler.declareField({c.access, c.type, name[0].str(), c.index ? documentations_[c.index - 1] : nullptr,
                                      CustomType::ofBox(name[1])},
                                     c.hasValue ? std::optional(c.value) : std::nullopt, c.where);
                break;
            case Kind::isConnection:
                handler.isConnection(name[0], name[1], c.where);
                break;
            case Kind::beginProto:
                handler.beginProto(name[0], c.where);
                break;
            case Kind::beginProtoBody:
                handler.beginProtoBody(c.where);
                break;
            case Kind::endProto:
                handler.endProto(c.where);
                break;
            case Kind::externProto:
                handler.externProto(name[0], externs_[c.index].fields, externs_[c.index].url, c.where);
                break;
            case Kind::route:
                handler.route(name[0], name[1], name[2], name[3], c.where);
                break;
            case Kind::importNode:
                handler.importNode(name[0], name[1], name[2], c.where);
                break;
            case Kind::exportNode:
                handler.exportNode(name[0], name[1], c.where);
                break;
            case Kind::comment:
                handler.comment(name[0], c.where);
                break;
            case Kind::documentation:
                handler.documentation(*documentations_[c.index], c.where);
                break;
        }
    }
}

std::string_view CommandList::firstNodeType() const {
    std::size_t protos = 0;
    for (const Command& command : commands_) {
        if (command.kind == Kind::beginProto) ++protos;
        if (command.kind == Kind::endProto) --protos;
        if (command.kind == Kind::beginNode && protos == 0) return command.names[0];
    }
    return {};
}

}  // namespace rtsg
