#include "reader_xml.h"

#include <algorithm>
#include <array>
#include <charconv>

namespace rtsg::detail {

bool readXml(std::string_view text, bool utf8, DocumentHandler& handler, Diagnostics& diagnostics,
             const ReaderProgress& progress) {
    return XmlReader(text, utf8, handler, diagnostics, progress).read();
}

XmlReader::XmlReader(std::string_view text, bool utf8, DocumentHandler& handler, Diagnostics& diagnostics,
                     const ReaderProgress& progress)
    : text_(text),
      utf8_(utf8),
      handler_(&handler),
      loud_(&handler),
      diagnostics_(diagnostics),
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
            static_cast<XmlReader*>(self)->start(name, attributes);
        },
        [](void* self, const char*) { static_cast<XmlReader*>(self)->end(); });
    XML_SetCharacterDataHandler(parser_, [](void* self, const char* characters, int count) {
        static_cast<XmlReader*>(self)->text({characters, static_cast<std::size_t>(count)});
    });
    XML_SetCdataSectionHandler(
        parser_, [](void* self) { static_cast<XmlReader*>(self)->beginSection(); },
        [](void* self) { static_cast<XmlReader*>(self)->inSection_ = false; });
    XML_SetEntityDeclHandler(parser_, [](void* user, const char*, int isParameter, const char*, int, const char*,
                                         const char*, const char*, const char*) {
        auto* self = static_cast<XmlReader*>(user);
        if (isParameter) return;
        self->refusedEntity_ = true;
        XML_StopParser(self->parser_, XML_FALSE);
    });
    std::string_view rest = text_;
    XML_Status status = XML_STATUS_OK;
    do {
        const std::size_t count = std::min<std::size_t>(rest.size(), 1u << 30);
        const std::string_view part = rest.substr(0, count);
        rest.remove_prefix(count);
        status = XML_Parse(parser_, part.data(), static_cast<int>(count), rest.empty());
    } while (status == XML_STATUS_OK && !rest.empty());
    if (refusedEntity_) {
        error("the document declares an entity, which is refused; reading ends here");
    } else if (status != XML_STATUS_OK) {
        const std::string inside = frames_.empty() ? "" : ", inside " + frames_.back().element;
        error(std::string("not well-formed XML: ") + XML_ErrorString(XML_GetErrorCode(parser_)) + inside +
              "; reading ends here");
    }
    closeAll();
    if (!began_) return false;
    handler_->endDocument();
    meter_.finish();
    return status == XML_STATUS_OK;
}

void XmlReader::closeAll() {
    skipDepth_ = 0;
    while (!frames_.empty()) pop();
}

SourceLocation XmlReader::where() {
    if (diagnostics_.dropped()) return {};
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
    if (!at || !attributeName_) return position_.of(s);
    // expat hands out copies: find the attribute again in the element's tag.
    const char* element = s;
    const std::string_view name(attributeName_);
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
            for (std::ptrdiff_t offset = at - attributeValue_; offset > 0 && s != stop && *s != quote; --offset) {
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

void XmlReader::report(Severity severity, const char* at, std::string text) {
    SourceLocation location;
    if (!diagnostics_.dropped()) location = utf8_ ? locate(at) : where();
    if (attributeName_) text = std::string(attributeName_) + ": " + text;
    diagnostics_.add(severity, location, std::move(text));
}

const XmlReader::Element* XmlReader::findElement(std::string_view name) {
    static constexpr std::array<Element, 19> elements = {{{"EXPORT", &XmlReader::startExport},
                                                          {"ExternProtoDeclare", &XmlReader::startExternProto},
                                                          {"IMPORT", &XmlReader::startImport},
                                                          {"IS", &XmlReader::startIs},
                                                          {"ProtoBody", &XmlReader::startBody},
                                                          {"ProtoDeclare", &XmlReader::startProtoDeclare},
                                                          {"ProtoInstance", &XmlReader::startInstance},
                                                          {"ProtoInterface", &XmlReader::startInterface},
                                                          {"ROUTE", &XmlReader::startRoute},
                                                          {"Scene", &XmlReader::startScene},
                                                          {"X3D", &XmlReader::startRoot},
                                                          {"component", &XmlReader::startComponent},
                                                          {"connect", &XmlReader::startConnect},
                                                          {"field", &XmlReader::startField},
                                                          {"fieldValue", &XmlReader::startFieldValue},
                                                          {"head", &XmlReader::startHead},
                                                          {"meta", &XmlReader::startMeta},
                                                          {"unit", &XmlReader::startUnit}}};
    const auto found = std::ranges::find(elements, name, &Element::name);
    return found == elements.end() || found->name.empty() ? nullptr : &*found;
}

void XmlReader::start(const char* name, Attributes attributes) {
    meter_.at(static_cast<std::size_t>(std::max<XML_Index>(XML_GetCurrentByteIndex(parser_), 0)));
    if (skipDepth_) {
        ++skipDepth_;
        return;
    }
    element_ = name;
    specified_ = XML_GetSpecifiedAttributeCount(parser_);
    const Element* element = findElement(name);
    if (!began_) begin(std::string_view(name) == "X3D" ? attributes : nullptr);
    if (element)
        (this->*element->handle)(attributes);
    else
        startNode(name, attributes);
}

void XmlReader::begin(Attributes attributes) {
    DocumentHeader header;
    header.encoding = Encoding::xml;
    if (attributes) {
        if (const char* version = attribute(attributes, "version")) header.version = version;
        if (const char* profile = attribute(attributes, "profile")) header.profile = profile;
    } else {
        error(std::string("the root element is ") + element_ + ", not X3D");
    }
    handler_->beginDocument(header);
    began_ = true;
}

void XmlReader::end() {
    if (skipDepth_) {
        --skipDepth_;
        return;
    }
    pop();
}

void XmlReader::beginSection() {
    inSection_ = true;
    if (skipDepth_ || !isTop(Inside::node) || !frames_.back().source) return;
    Source& source = *frames_.back().source;
    if (!source.hasSection && source.text.find_first_not_of(" \t\r\n") == source.text.npos) source.text.clear();
    source.hasSection = true;
}

void XmlReader::text(std::string_view characters) {
    if (skipDepth_ || !isTop(Inside::node) || !frames_.back().source) return;
    Source& source = *frames_.back().source;
    if (source.hasSection && !inSection_ && characters.find_first_not_of(" \t\r\n") == characters.npos) return;
    source.text += characters;
}

const char* XmlReader::attribute(Attributes attributes, std::string_view name) const {
    for (int i = 0; i < specified_; i += 2)
        if (attributes[i] == name) return attributes[i + 1];
    return nullptr;
}

bool XmlReader::parseAttribute(const char* name, const char* value, FieldType type, Value& out) {
    attributeName_ = name;
    attributeValue_ = value;
    FieldTextParser parser(value, value + std::string_view(value).size(), TextSyntax::xml, *this);
    const bool usable = parser.parse(type, out);
    attributeName_ = nullptr;
    return usable;
}

void XmlReader::push(Inside inside) {
    if (!frames_.empty()) frames_.back().hasChildren = true;
    Frame frame{};
    frame.inside = inside;
    frame.open = where();
    frame.element = element_;
    frames_.push_back(std::move(frame));
}

/// Leaves out the element being started, and all in it.
void XmlReader::skip(std::string why) {
    if (!why.empty()) error(std::move(why));
    skipDepth_ = 1;
}

/// From here to the end of the element about to be pushed the handler hears nothing.
void XmlReader::mute() {
    if (mutedAt_ != kNotMuted) return;
    mutedAt_ = frames_.size();
    handler_ = &silent_;
}

void XmlReader::pop() {
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
            if (frame.declared) tellDeclaration(frame);
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

void XmlReader::startRoot(Attributes) {
    if (!frames_.empty()) return skip("X3D is the root element only");
    push(Inside::root);
}

void XmlReader::startHead(Attributes) {
    if (!isTop(Inside::root)) return skip("head belongs directly in X3D");
    push(Inside::head);
}

void XmlReader::startScene(Attributes) {
    if (!frames_.empty() && !isTop(Inside::root)) return skip("Scene belongs directly in X3D");
    push(Inside::scene);
}

void XmlReader::startMeta(Attributes attributes) {
    const char* name = attribute(attributes, "name");
    const char* content = attribute(attributes, "content");
    if (isTop(Inside::head) && name && content)
        handler_->meta(name, content);
    else
        error("meta needs a name and a content, and belongs in head");
    push(Inside::leaf);
}

void XmlReader::startComponent(Attributes attributes) {
    const char* name = attribute(attributes, "name");
    const char* level = attribute(attributes, "level");
    Value number(std::int32_t{1});
    if (!isTop(Inside::head) || !name)
        error("component needs a name, and belongs in head");
    else if (!level || parseAttribute("level", level, FieldType::SFInt32, number))
        handler_->component(name, number.as<std::int32_t>());
    push(Inside::leaf);
}

void XmlReader::startUnit(Attributes attributes) {
    const char* category = attribute(attributes, "category");
    const char* name = attribute(attributes, "name");
    const char* factor = attribute(attributes, "conversionFactor");
    Value number;
    if (!isTop(Inside::head) || !category || !name || !factor)
        error("unit needs category, name and conversionFactor, and belongs in head");
    else if (parseAttribute("conversionFactor", factor, FieldType::SFDouble, number)) {
        hasUnits_ = true;
        if (number.as<double>() > 0)
            handler_->unit(category, name, number.as<double>());
        else
            error("a unit's conversion factor must be positive");
    }
    push(Inside::leaf);
}

void XmlReader::startRoute(Attributes attributes) {
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

void XmlReader::startImport(Attributes attributes) {
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

void XmlReader::startExport(Attributes attributes) {
    if (!takesStatements()) return skip("EXPORT has no place here");
    const char* local = attribute(attributes, "localDEF");
    const char* exported = attribute(attributes, "AS");
    if (local)
        handler_->exportNode(local, exported ? exported : local, where());
    else
        error("EXPORT needs localDEF");
    push(Inside::leaf);
}

void XmlReader::startProtoDeclare(Attributes attributes) {
    if (!takesStatements()) return skip("ProtoDeclare has no place here");
    const char* name = attribute(attributes, "name");
    if (!name || !*name) return skip("ProtoDeclare needs a name");
    if (findBuiltinType(name)) {
        error("PROTO " + std::string(name) + " has the name of a built-in node, which stays; it is left out");
        mute();
    } else if (types_.declaredHere(name)) {
        error("there is a PROTO " + std::string(name) + " already, which stays; this one is left out");
        mute();
    }
    handler_->beginProto(name, where());
    push(Inside::protoDeclare);
    frames_.back().prototype = std::make_unique<Prototype>();
    frames_.back().prototype->type = std::make_shared<ProtoType>();
    frames_.back().prototype->type->name = name;
}

void XmlReader::startExternProto(Attributes attributes) {
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
    frames_.back().prototype = std::move(prototype);
}

void XmlReader::startInterface(Attributes) {
    if (!isTop(Inside::protoDeclare) || frames_.back().prototype->hasBody)
        return skip("ProtoInterface belongs in ProtoDeclare, before ProtoBody");
    push(Inside::interface);
}

void XmlReader::startBody(Attributes) {
    if (!isTop(Inside::protoDeclare) || frames_.back().prototype->hasBody)
        return skip("one ProtoBody belongs in each ProtoDeclare");
    frames_.back().prototype->hasBody = true;
    handler_->beginProtoBody(where());
    push(Inside::body);
    types_.pushScope();
    ++bodies_;
}

void XmlReader::endProto(Frame& frame) {
    const std::shared_ptr<ProtoType>& type = frame.prototype->type;
    if (frame.inside == Inside::externProto) {
        if (types_.declareProto(type)) {
            const auto& fields = type->fields.all();
            handler_->externProto(type->name, {fields.begin(), fields.end()}, frame.prototype->url, frame.open);
        } else {
            diagnostics_.error(frame.open, "there is a node type " + type->name + " already, which stays");
        }
        return;
    }
    if (!frame.prototype->hasBody) {
        diagnostics_.error(frame.open, "PROTO " + type->name + " has no body");
        handler_->beginProtoBody(frame.open);
    }
    handler_->endProto(where());
    types_.declareProto(type);  // only now: a prototype is unknown inside its own body (4.4.4.4)
}

}  // namespace rtsg::detail
