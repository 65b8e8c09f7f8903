// Elements that are no nodes, for XML and JSON: scene, head, routes, prototypes, field declarations.
#include "reader_element.h"

#include <algorithm>
#include <array>

namespace rtsg::detail {

ElementReader::ElementReader(Encoding encoding, DocumentHandler& handler, Diagnostics& diagnostics,
                             std::shared_ptr<const Dialect> dialect)
    : handler_(&handler),
      loud_(&handler),
      diagnostics_(diagnostics),
      encoding_(encoding),
      plainStrings_(encoding == Encoding::json),
      types_(std::move(dialect)) {
    types_.setInstancesAreReported();
}

bool ElementReader::finish() {
    skipDepth_ = 0;
    while (!frames_.empty()) pop();
    if (began_) handler_->endDocument();
    return began_;
}

void ElementReader::report(Severity severity, const char* at, std::string text) {
    SourceLocation location;
    if (!diagnostics_.dropped()) location = locate(at);
    if (attributeName_) text = std::string(attributeName_) + ": " + text;
    diagnostics_.add(severity, location, std::move(text));
}

const ElementReader::Element* ElementReader::findElement(std::string_view name) {
    static constexpr std::array<Element, 19> elements = {{{"EXPORT", &ElementReader::startExport},
                                                          {"ExternProtoDeclare", &ElementReader::startExternProto},
                                                          {"IMPORT", &ElementReader::startImport},
                                                          {"IS", &ElementReader::startIs},
                                                          {"ProtoBody", &ElementReader::startBody},
                                                          {"ProtoDeclare", &ElementReader::startProtoDeclare},
                                                          {"ProtoInstance", &ElementReader::startInstance},
                                                          {"ProtoInterface", &ElementReader::startInterface},
                                                          {"ROUTE", &ElementReader::startRoute},
                                                          {"Scene", &ElementReader::startScene},
                                                          {"X3D", &ElementReader::startRoot},
                                                          {"component", &ElementReader::startComponent},
                                                          {"connect", &ElementReader::startConnect},
                                                          {"field", &ElementReader::startField},
                                                          {"fieldValue", &ElementReader::startFieldValue},
                                                          {"head", &ElementReader::startHead},
                                                          {"meta", &ElementReader::startMeta},
                                                          {"unit", &ElementReader::startUnit}}};
    const auto found = std::ranges::find(elements, name, &Element::name);
    return found == elements.end() || found->name.empty() ? nullptr : &*found;
}

void ElementReader::start(const char* name, Attributes attributes, int specified) {
    if (skipDepth_) {
        ++skipDepth_;
        return;
    }
    element_ = name;
    specified_ = specified;
    const Element* element = findElement(name);
    if (!began_) begin(std::string_view(name) == "X3D" ? attributes : nullptr);
    if (element)
        (this->*element->handle)(attributes);
    else
        startNode(name, attributes);
}

void ElementReader::begin(Attributes attributes) {
    DocumentHeader header;
    header.encoding = encoding_;
    header.where = where();
    if (attributes) {
        if (const char* version = attribute(attributes, "version")) header.version = version;
        types_.setVersion(header.version);
        if (const char* profile = attribute(attributes, "profile")) header.profile = profile;
    } else {
        error(std::string("the root element is ") + element_ + ", not X3D");
    }
    header.valuesFirst = true;
    handler_->beginDocument(header);
    began_ = true;
    for (const auto& [text, at] : early_) handler_->comment(text, at);
    early_.clear();
}

void ElementReader::end() {
    if (skipDepth_) {
        --skipDepth_;
        return;
    }
    pop();
}

void ElementReader::beginSection() {
    inSection_ = true;
    if (skipDepth_ || !isTop(Inside::node) || !frames_.back().source) return;
    Source& source = *frames_.back().source;
    if (!source.hasSection && source.text.find_first_not_of(" \t\r\n") == source.text.npos) source.text.clear();
    source.hasSection = true;
}

void ElementReader::text(std::string_view characters) {
    if (skipDepth_ || !isTop(Inside::node) || !frames_.back().source) return;
    Source& source = *frames_.back().source;
    if (source.hasSection && !inSection_ && characters.find_first_not_of(" \t\r\n") == characters.npos) return;
    source.text += characters;
}

void ElementReader::comment(std::string_view text) {
    if (skipDepth_) return;
    const std::string tidy = tidyComment(text);
    if (tidy.empty()) return;
    if (!began_)
        early_.emplace_back(tidy, where());
    else
        handler_->comment(tidy, where());
}

/// Null where the element says nothing about itself.
std::shared_ptr<const Documentation> ElementReader::documentation(Attributes attributes) const {
    const char* appinfo = attribute(attributes, "appinfo");
    const char* documentation = attribute(attributes, "documentation");
    if (!appinfo && !documentation) return nullptr;
    return std::make_shared<const Documentation>(
        Documentation{appinfo ? appinfo : "", documentation ? documentation : ""});
}

const char* ElementReader::attribute(Attributes attributes, std::string_view name) const {
    for (int i = 0; i < specified_; i += 2)
        if (attributes[i] == name) return attributes[i + 1];
    return nullptr;
}

FieldType ElementReader::longAttribute(std::string_view element, std::string_view name,
                                       std::string_view fieldName) const {
    if (skipDepth_) return FieldType::SFNode;
    FieldRef field;
    if (element == "fieldValue" && name == "value" && isTop(Inside::node) && frames_.back().shape.proto) {
        field = findField(frames_.back().shape, fieldName);
    } else if (!findElement(element)) {
        const NodeShape shape = types_.find(element);
        if (shape.type) field = findField(shape, name);
    }
    const bool many = field && (isMF(field.type) || field.type == FieldType::SFImage);
    const FieldType of = field ? sf(field.type) : FieldType::SFNode;
    const bool hasNumbers =
        of != FieldType::SFString && of != FieldType::SFNode && of != FieldType::SFBool && of != FieldType::SFCustom;
    return many && hasNumbers ? field.type : FieldType::SFNode;
}

bool ElementReader::parseAttribute(const char* name, const char* value, FieldType type, Value& out,
                                   const CustomType* custom) {
    if (Value* before = parsedBefore(value)) {
        if (before->type() != type) return false;
        out = std::move(*before);
        return true;
    }
    if (plainStrings_ && type == FieldType::SFString) {
        out = Value(String(value));
        return true;
    }
    attributeName_ = name;
    attributeValue_ = value;
    FieldTextParser parser(value, value + std::string_view(value).size(), TextSyntax::xml, *this);
    const bool usable = parser.parse(type, out, custom);
    attributeName_ = nullptr;
    return usable;
}

void ElementReader::push(Inside inside) {
    if (!frames_.empty()) frames_.back().hasChildren = true;
    Frame frame{};
    frame.inside = inside;
    frame.open = where();
    frame.element = element_;
    frames_.push_back(std::move(frame));
}

/// Leaves out the element being started, and all in it.
void ElementReader::skip(std::string why) {
    if (!why.empty()) error(std::move(why));
    skipDepth_ = 1;
}

/// From here to the end of the element about to be pushed the handler hears nothing.
void ElementReader::mute() {
    if (mutedAt_ != kNotMuted) return;
    mutedAt_ = frames_.size();
    handler_ = &silent_;
}

void ElementReader::pop() {
    Frame frame = std::move(frames_.back());
    frames_.pop_back();
    switch (frame.inside) {
        case Inside::node:
            endNode(frame);
            break;
        case Inside::protoDeclare:
        case Inside::externProto:
            endProto(frame);
            break;
        case Inside::body:
            types_.popScope();
            --bodies_;
            break;
        case Inside::declaration:
            if (frame.declared) reportDeclaration(frame);
            break;
        case Inside::value:
            if (!frame.hasChildren && frame.into && sf(frame.into.type) == FieldType::SFNode)
                handler_->setField(frame.into.name, Value::zero(frame.into.type), frame.open);
            break;
        default:
            break;
    }
    if (frames_.size() == mutedAt_) {
        handler_ = loud_;
        mutedAt_ = kNotMuted;
    }
}

void ElementReader::startRoot(Attributes) {
    if (!frames_.empty()) return skip("X3D is the root element only");
    push(Inside::root);
}

void ElementReader::startHead(Attributes) {
    if (!isTop(Inside::root)) return skip("head belongs directly in X3D");
    push(Inside::head);
}

void ElementReader::startScene(Attributes) {
    if (!frames_.empty() && !isTop(Inside::root)) return skip("Scene belongs directly in X3D");
    push(Inside::scene);
}

void ElementReader::startMeta(Attributes attributes) {
    const char* name = attribute(attributes, "name");
    const char* content = attribute(attributes, "content");
    if (isTop(Inside::head) && name && content)
        handler_->meta(name, content, where());
    else
        error("meta needs a name and a content, and belongs in head");
    push(Inside::leaf);
}

void ElementReader::startComponent(Attributes attributes) {
    const char* name = attribute(attributes, "name");
    const char* level = attribute(attributes, "level");
    Value number(std::int32_t{1});
    if (!isTop(Inside::head) || !name)
        error("component needs a name, and belongs in head");
    else if (!level || parseAttribute("level", level, FieldType::SFInt32, number))
        handler_->component(name, number.as<std::int32_t>(), where());
    push(Inside::leaf);
}

void ElementReader::startUnit(Attributes attributes) {
    const char* category = attribute(attributes, "category");
    const char* name = attribute(attributes, "name");
    const char* factor = attribute(attributes, "conversionFactor");
    Value number;
    if (!isTop(Inside::head) || !category || !name || !factor)
        error("unit needs category, name and conversionFactor, and belongs in head");
    else if (parseAttribute("conversionFactor", factor, FieldType::SFDouble, number)) {
        if (number.as<double>() > 0) {
            units_.set(category, number.as<double>());
            handler_->unit(category, name, number.as<double>(), where());
        } else {
            error("a unit's conversion factor must be positive");
        }
    }
    push(Inside::leaf);
}

void ElementReader::startRoute(Attributes attributes) {
    if (!takesStatements()) return skip("ROUTE has no place here");
    const char* fromNode = attribute(attributes, "fromNode");
    const char* fromField = attribute(attributes, "fromField");
    const char* toNode = attribute(attributes, "toNode");
    const char* toField = attribute(attributes, "toField");
    const auto canonical = [&](const char* node, const char* field) {
        const NodeShape* shape = types_.defined(node);
        const FieldRef found = shape ? findField(*shape, field) : FieldRef{};
        return found ? found.name : std::string_view(field);
    };
    if (fromNode && fromField && toNode && toField)
        handler_->route(fromNode, canonical(fromNode, fromField), toNode, canonical(toNode, toField), where());
    else
        error("ROUTE needs fromNode, fromField, toNode and toField");
    push(Inside::leaf);
}

void ElementReader::startImport(Attributes attributes) {
    if (!takesStatements()) return skip("IMPORT has no place here");
    const char* from = attribute(attributes, "inlineDEF");
    const char* exported = attribute(attributes, "importedDEF");
    if (!exported) exported = attribute(attributes, "exportedDEF");  // as in X3D 3.0
    const char* local = attribute(attributes, "AS");
    if (from && exported)
        handler_->importNode(from, exported, local ? local : exported, where());
    else
        error("IMPORT needs inlineDEF and importedDEF");
    push(Inside::leaf);
}

void ElementReader::startExport(Attributes attributes) {
    if (!takesStatements()) return skip("EXPORT has no place here");
    const char* local = attribute(attributes, "localDEF");
    const char* exported = attribute(attributes, "AS");
    if (local)
        handler_->exportNode(local, exported ? exported : local, where());
    else
        error("EXPORT needs localDEF");
    push(Inside::leaf);
}

void ElementReader::startProtoDeclare(Attributes attributes) {
    if (!takesStatements()) return skip("ProtoDeclare has no place here");
    const char* name = attribute(attributes, "name");
    if (!name || !*name) return skip("ProtoDeclare needs a name");
    auto proto = std::make_shared<ProtoType>();
    proto->name = types_.protoName(name);
    proto->calledInFile = name;
    if (proto->name.empty()) {
        error("PROTO " + std::string(name) + " has the name of a built-in node, which stays; it is left out");
        mute();
    } else if (types_.declaredHere(name)) {
        error("there is a PROTO " + std::string(name) + " already, which stays; this one is left out");
        mute();
    } else if (proto->name != name) {
        diagnostics_.warning(where(), renamedProto(*proto));
    }
    if (const auto about = documentation(attributes)) handler_->documentation(*about, where());
    handler_->beginProto(proto->name.empty() ? std::string_view(name) : std::string_view(proto->name), where());
    push(Inside::protoDeclare);
    frames_.back().prototype = std::make_unique<Prototype>();
    frames_.back().prototype->type = std::move(proto);
}

void ElementReader::startExternProto(Attributes attributes) {
    if (!takesStatements()) return skip("ExternProtoDeclare has no place here");
    const char* name = attribute(attributes, "name");
    if (!name || !*name) return skip("ExternProtoDeclare needs a name");
    push(Inside::externProto);
    auto prototype = std::make_unique<Prototype>();
    prototype->type = std::make_shared<ProtoType>();
    prototype->type->name = name;
    Value url;
    if (const char* urls = attribute(attributes, "url"); urls && parseAttribute("url", urls, FieldType::MFString, url))
        for (const String& one : url.as<Array<String>>()) prototype->url.push_back(one.str());
    prototype->about = documentation(attributes);
    frames_.back().prototype = std::move(prototype);
}

void ElementReader::startInterface(Attributes) {
    if (!isTop(Inside::protoDeclare) || frames_.back().prototype->hasBody)
        return skip("ProtoInterface belongs in ProtoDeclare, before ProtoBody");
    push(Inside::interface);
}

void ElementReader::startBody(Attributes) {
    if (!isTop(Inside::protoDeclare) || frames_.back().prototype->hasBody)
        return skip("one ProtoBody belongs in each ProtoDeclare");
    frames_.back().prototype->hasBody = true;
    handler_->beginProtoBody(where());
    push(Inside::body);
    types_.pushScope();
    ++bodies_;
}

void ElementReader::endExternProto(Frame& frame) {
    const std::shared_ptr<ProtoType>& type = frame.prototype->type;
    switch (types_.declareExtern(type)) {
        case ReaderTypes::Extern::isBuiltin:
            return diagnostics_.warning(frame.open, externIsBuiltin(type->name));
        case ReaderTypes::Extern::isOurs:
            return;
        case ReaderTypes::Extern::isThere:
            return diagnostics_.error(frame.open, alreadyDeclared(type->name));
        case ReaderTypes::Extern::renamed:
            diagnostics_.warning(frame.open, renamedProto(*type));
            break;
        case ReaderTypes::Extern::declared:
            break;
    }
    const auto& fields = type->fields.all();
    if (frame.prototype->about) handler_->documentation(*frame.prototype->about, frame.open);
    handler_->externProto(type->name, {fields.begin(), fields.end()}, frame.prototype->url, frame.open);
}

void ElementReader::endProto(Frame& frame) {
    const std::shared_ptr<ProtoType>& type = frame.prototype->type;
    if (frame.inside == Inside::externProto) return endExternProto(frame);
    if (!frame.prototype->hasBody) {
        diagnostics_.error(frame.open, "PROTO " + type->name + " has no body");
        handler_->beginProtoBody(frame.open);
    }
    handler_->endProto(where());
    if (!type->name.empty())
        types_.declareProto(type,
                            type->calledInFile);  // only now: a prototype is unknown inside its own body (4.4.4.4)
}

}  // namespace rtsg::detail
