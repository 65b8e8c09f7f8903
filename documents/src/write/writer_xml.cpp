// XML. A node's attributes may come after its children, unless the document says otherwise: then the start tag of each
// open node is a gap in the text that is filled when the node ends; text goes out as far as the first gap, and long
// lists of numbers become text then.
#include <algorithm>
#include <iterator>
#include <list>
#include <set>
#include <utility>

#include <rtsg/core/web_address.h>

#include "commands/units.h"
#include "writer_common.h"
#include "writer_waiting.h"

namespace rtsg::detail {

namespace {

class XmlWriter final : public DocumentHandler {
  public:
    XmlWriter(TextSink sink, Diagnostics& diagnostics)
        : sink_(std::move(sink)),
          diagnostics_(diagnostics),
          waiting_([](std::string& text, const WaitingText& piece, const std::function<void()>& full) {
              appendWrapped(text, piece.numbers, TextSyntax::xml, piece.indent, full);
          }) {
        pieces_.emplace_back();
    }

    void beginDocument(const DocumentHeader& header) override {
        write("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<X3D");
        write(attribute("profile", header.profile.empty() ? "Full" : header.profile, {}));
        version_ = x3dVersion(header);
        valuesFirst_ = header.valuesFirst;
        write(attribute("version", version_, {}) + ">");
    }
    void endDocument() override {
        openScene();
        write("\n  </Scene>\n</X3D>\n");
        flush(0);
        uses_.report(diagnostics_);
    }

    void component(std::string_view name, int level, SourceLocation) override {
        head("component", attribute("name", name, {}) + attribute("level", std::to_string(level), {}));
    }
    void meta(std::string_view name, std::string_view content, SourceLocation) override {
        head("meta", attribute("name", name, {}) + attribute("content", content, {}));
    }
    void unit(std::string_view category, std::string_view name, double factor, SourceLocation) override {
        units_.set(category, factor);
        head("unit", attribute("category", category, {}) + attribute("name", name, {}) +
                         attribute("conversionFactor", printFieldText(Value(factor)), {}));
    }

    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation where) override {
        NodeShape shape = types_.find(type);
        if (shape.type && declaresFields(*shape.type)) shape.own = std::make_shared<DeclaredFields>();
        const std::string container = nodeInsertPoint(field, shape);
        if (!def.empty()) types_.define(def, shape);
        noteFirst(shape);
        Frame frame{};
        frame.kind = Kind::node;
        frame.element = shape.proto ? "ProtoInstance" : shape.unknown ? unknownName(type, where) : std::string(type);
        write("<" + frame.element);
        if (shape.proto) write(attribute("name", type, where));
        if (!def.empty()) write(attribute("DEF", def, where));
        if (!container.empty()) write(attribute("containerField", container, where));
        frame.shape = std::move(shape);
        frame.indent = indent() + 1;
        // A Script's source text is an attribute or content, which shows at its end; an IS comes before all content but
        // fields.
        if (valuesFirst_ && !frame.shape.own && protos_ == 0)
            frame.tagOpen = true;
        else
            openGap(frame);
        frames_.push_back(std::move(frame));
    }
    void endNode(SourceLocation) override {
        closeValue();
        Frame frame = std::move(frames_.back());
        frames_.pop_back();
        if (!frame.gap) {
            endDirect(frame);
            return;
        }
        std::string& gap = *frame.gap;
        const bool empty = !frame.filled && frame.connections.empty() && frame.source.view().empty();
        gap += empty ? "/>" : ">";
        // Fields of a node's own are known to no reader before they come: what connects them follows them, and its
        // source text follows that.
        (frame.shape.own ? pieces_.back().text : gap) += connectionElement(frame);
        if (!empty) {
            if (frame.source.view().empty())
                newLine();
            else
                writeSource(frame.source.view());
            write("</" + frame.element + ">");
        }
        closeGap(frame);
    }
    void useNode(std::string_view def, std::string_view field, SourceLocation where) override {
        const NodeShape* defined = types_.defined(def);
        NodeShape shape;
        if (defined)
            shape = *defined;
        else
            shape.type = findBuiltinType("Group"), uses_.use(def, where);  // the element must have some name
        const std::string container = nodeInsertPoint(field, shape);
        noteFirst(shape);
        write(shape.proto     ? "<ProtoInstance" + attribute("name", shape.proto->name, where)
              : shape.unknown ? "<" + spellName(shape.name(), Spelling::element)
                              : "<" + std::string(shape.name()));
        write(attribute("USE", def, where));
        if (!container.empty()) write(attribute("containerField", container, where));
        write("/>");
    }

    void setField(std::string_view field, Value value, SourceLocation where) override {
        Frame& frame = frames_.back();
        const bool nodes = sf(value.type()) == FieldType::SFNode;
        if (!units_.areStandard()) units_.fromStandard(findField(frame.shape, field).definition, value);
        if (frame.shape.proto) {
            line();
            write("<fieldValue" + attribute("name", field, where));
            if (!nodes) write(valueAttribute("value", value, where));
            write("/>");
            return;
        }
        if (nodes) return;  // NULL and the empty list are the default of a field of nodes
        if (frame.shape.type && field == "url" && declaresFields(*frame.shape.type) && keepSource(value)) return;
        if (frame.shape.unknown && value.holds<String>()) {
            // The field's name as it was read.
            const std::string name = spellName(field, Spelling::attribute);
            if (frame.unknownGiven.insert(name).second)
                writeAttribute(frame, attribute(name, value.as<String>().view(), where), where);
            return;
        }
        if (frame.gap && !isText(value)) {
            *frame.gap += " " + std::string(spelled(frame.shape, field)) + "='";
            if (isLongList(value)) {
                WaitingText& piece = *pieces_.emplace(frame.gapAt, std::exchange(*frame.gap, {}));
                piece.numbers = std::move(value);
                piece.indent = spaces(indent() + 1);
                waiting_.settle(piece);
            } else {
                appendWrapped(*frame.gap, value, TextSyntax::xml, spaces(indent() + 1));
            }
            *frame.gap += "'";
            return;
        }
        if (!frame.tagOpen || isText(value))
            return writeAttribute(frame, valueAttribute(spelled(frame.shape, field), value, where), where);
        // Long lists of numbers go out as they are printed.
        std::string& text = pieces_.back().text;
        text += " " + std::string(spelled(frame.shape, field)) + "='";
        appendWrapped(text, value, TextSyntax::xml, spaces(indent() + 1), [this] { flush(kFlushAt); });
        write("'");
    }
    void declareField(const FieldDeclaration& field, std::optional<Value> value, SourceLocation where) override {
        if (value) units_.fromStandard(nullptr, *value);
        closeValue();
        Frame& frame = frames_.back();
        openInterface(frame);
        if (frame.shape.own) frame.shape.own->add(field);
        if (frame.proto) frame.proto->fields.add(field);
        line();
        write(declaration(field, where));
        if (sf(field.type) == FieldType::SFNode && !value && field.access != Access::inputOnly &&
            field.access != Access::outputOnly) {
            frame.openValue = "field";
            frame.valueName = field.name;
            frame.valueEmpty = true;
            return;
        }
        if (value && sf(field.type) != FieldType::SFNode) write(valueAttribute("value", *value, where));
        write("/>");
    }
    void isConnection(std::string_view nodeField, std::string_view protoField, SourceLocation where) override {
        closeValue();
        Frame& frame = frames_.back();
        frame.connections += "\n" + std::string(spaces(frame.indent + 1), ' ') + "<connect" +
                             attribute("nodeField", nodeField, where) + attribute("protoField", protoField, where) +
                             "/>";
    }

    void beginProto(std::string_view name, SourceLocation where) override {
        ++protos_;
        line();
        write("<ProtoDeclare" + attribute("name", name, where) + std::exchange(about_, {}) + ">");
        Frame frame{};
        frame.kind = Kind::interface;
        frame.element = "ProtoDeclare";
        frame.proto = std::make_shared<ProtoType>();
        frame.proto->name = name;
        frame.indent = indent() + 2;
        frames_.push_back(std::move(frame));
    }
    void beginProtoBody(SourceLocation) override {
        closeValue();
        Frame& frame = frames_.back();
        if (frame.filled) {
            newLine(frame.indent - 1);
            write("</ProtoInterface>");
        }
        newLine(frame.indent - 1);
        write("<ProtoBody>");
        frame.kind = Kind::body;
        types_.pushScope();
    }
    void endProto(SourceLocation) override {
        --protos_;
        const std::shared_ptr<ProtoType> proto = frames_.back().proto;
        newLine(frames_.back().indent - 1);
        write("</ProtoBody>");
        frames_.pop_back();
        newLine();
        write("</ProtoDeclare>");
        types_.popScope();
        types_.declareProto(proto);
    }
    void externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                     const std::vector<std::string>& url, SourceLocation where) override {
        line();
        auto proto = std::make_shared<ProtoType>();
        proto->name = name;
        Array<String> urls;
        for (const std::string& one : url) urls.push_back(one);
        write("<ExternProtoDeclare" + attribute("name", name, where) + std::exchange(about_, {}) +
              valueAttribute("url", Value(std::move(urls)), where));
        write(fields.empty() ? "/>" : ">");
        for (const FieldDeclaration& field : fields) {
            newLine(indent() + 1);
            write(declaration(field, where) + "/>");
            proto->fields.add(field);
        }
        if (!fields.empty()) {
            newLine();
            write("</ExternProtoDeclare>");
        }
        types_.declareProto(proto);
    }

    void route(std::string_view fromNode, std::string_view fromField, std::string_view toNode, std::string_view toField,
               SourceLocation where) override {
        line();
        write("<ROUTE" + attribute("fromNode", fromNode, where) + attribute("fromField", fromField, where) +
              attribute("toNode", toNode, where) + attribute("toField", toField, where) + "/>");
    }
    void importNode(std::string_view inlineDef, std::string_view exported, std::string_view local,
                    SourceLocation where) override {
        uses_.import(local);
        line();
        write("<IMPORT" + attribute("inlineDEF", inlineDef, where) + attribute("importedDEF", exported, where) +
              attribute("AS", local, where) + "/>");
    }
    void exportNode(std::string_view local, std::string_view exported, SourceLocation where) override {
        line();
        write("<EXPORT" + attribute("localDEF", local, where) + attribute("AS", exported, where) + "/>");
    }
    void comment(std::string_view text, SourceLocation) override {
        if (frames_.empty() && field_ != Where::scene) {
            newLine(field_ == Where::root ? 1 : 2);
        } else if (!frames_.empty() && !frames_.back().openValue.empty()) {
            if (frames_.back().valueEmpty) write(">");
            frames_.back().valueEmpty = false;
            newLine();
        } else {
            if (!frames_.empty()) openInterface(frames_.back());
            line();
        }
        // Two hyphens end a comment, and one at its end would make two.
        std::string spaced;
        for (const char c : text) {
            if (c == '-' && spaced.ends_with('-')) spaced += ' ';
            spaced += static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t' ? ' ' : c;
        }
        write("<!-- " + spaced + " -->");
    }
    void documentation(const Documentation& about, SourceLocation where) override { about_ = describe(about, where); }

  private:
    enum class Kind : std::uint8_t { node, interface, body };
    enum class Where : std::uint8_t { root, head, scene };
    struct Frame {
        Kind kind;
        std::string element;
        NodeShape shape;
        std::shared_ptr<ProtoType> proto;
        std::string* gap = nullptr;  // attributes go here; ends with the start tag
        Rope::iterator gapAt{};
        bool tagOpen = false;     // no gap: attributes are written as they come
        std::string connections;  // the connect elements of its IS
        std::size_t indent = 0;   // of its content
        bool filled = false;      // it has content (interface: the ProtoInterface is open)
        String source;            // text that goes into CDATA
        std::string openValue;    // "field" or "fieldValue" whose nodes are coming
        std::string valueName;
        bool valueEmpty = false;             // its start tag is still open
        std::set<std::string> unknownGiven;  // attributes of a node of unknown type
    };

    // ---- text and gaps
    void write(std::string_view text) {
        pieces_.back().text += text;
        if (openGaps_ == 0) return flush(kFlushAt);
        if (pieces_.back().text.size() < kFlushAt) return;
        waiting_.settle(pieces_.back());
        pieces_.emplace_back();
    }
    /// Passes on the text before the first gap, if that is at least `least` bytes.
    void flush(std::size_t minimum) {
        if (openGaps_ != 0 || (pieces_.size() == 1 && pieces_.back().text.size() < minimum)) return;
        if (pieces_.size() == 1) {
            sink_(pieces_.back().text);
            return pieces_.back().text.clear();
        }
        for (WaitingText& piece : pieces_)
            if (!waiting_.send(piece, sink_))
                diagnostics_.error({}, "what waited in a file without a name cannot be read: text is missing here");
        pieces_.resize(1);
        waiting_.clear();
    }
    void openGap(Frame& frame) {
        frame.gap = &pieces_.emplace_back().text;
        frame.gapAt = std::prev(pieces_.end());
        pieces_.emplace_back();
        ++openGaps_;
    }
    void closeGap(const Frame& frame) {
        if (--openGaps_ == 0) return flush(kFlushAt);
        // Between two gaps that stay open there is one text.
        const auto joined = waiting_.join(pieces_, frame.gapAt);
        if (const auto next = std::next(joined); next != pieces_.end()) waiting_.join(pieces_, next);
    }

    void writeAttribute(Frame& frame, const std::string& text, SourceLocation where) {
        if (frame.gap)
            *frame.gap += text;
        else if (frame.tagOpen)
            write(text);
        else
            diagnostics_.error(
                where, "a value of " + frame.element +
                           " came behind its nodes and cannot be written any more:" + text.substr(0, text.find('=')));
    }
    void openInterface(Frame& frame) {
        if (frame.kind != Kind::interface || frame.filled) return;
        frame.filled = true;
        newLine(frame.indent - 1);
        write("<ProtoInterface>");
    }
    /// Closes the start tag of a node that has something between its tags.
    void closeTag(Frame& frame) {
        if (!frame.tagOpen) return;
        frame.tagOpen = false;
        write(">");
    }
    /// The IS of the connections that have come since the last time, if there are any.
    static std::string connectionElement(Frame& frame) {
        if (frame.connections.empty()) return {};
        const std::string before = "\n" + std::string(spaces(frame.indent), ' ');
        return before + "<IS>" + std::exchange(frame.connections, {}) + before + "</IS>";
    }
    void reportConnections(Frame& frame) {
        if (frame.connections.empty()) return;
        closeTag(frame);
        write(connectionElement(frame));
        frame.filled = true;
    }
    void endDirect(Frame& frame) {
        reportConnections(frame);
        if (frame.tagOpen) return write("/>");
        newLine();
        write("</" + frame.element + ">");
    }

    // ---- lines
    /// Of what comes next in the innermost element.
    std::size_t indent() const {
        return frames_.empty() ? 2 : frames_.back().indent + (frames_.back().openValue.empty() ? 0 : 1);
    }
    void newLine() { newLine(indent()); }
    void newLine(std::size_t indent) {
        write("\n");
        write(std::string(spaces(indent), ' '));
    }
    /// A new line in the innermost element for anything but a node.
    void line() {
        if (frames_.empty()) {
            openScene();
        } else {
            closeValue();
            Frame& frame = frames_.back();
            if (frame.kind == Kind::node && !frame.gap) {
                closeTag(frame);
                reportConnections(frame);
            }
            frame.filled = true;
        }
        newLine();
    }
    void openScene() {
        if (field_ == Where::scene) return;
        if (field_ == Where::head) write("\n  </head>");
        write("\n  <Scene>");
        field_ = Where::scene;
    }
    void head(const char* element, const std::string& attributes) {
        if (field_ == Where::scene) {
            diagnostics_.warning({}, std::string(element) + " behind the first node cannot be written in XML");
            return;
        }
        if (field_ == Where::root) write("\n  <head>");
        field_ = Where::head;
        write("\n    <" + std::string(element) + attributes + "/>");
    }
    /// Ends a field or fieldValue element whose nodes have come.
    void closeValue() {
        if (frames_.empty() || frames_.back().openValue.empty()) return;
        Frame& frame = frames_.back();
        const std::string element = std::move(frame.openValue);
        frame.openValue.clear();
        if (frame.valueEmpty) {
            write("/>");
            return;
        }
        newLine();
        write("</" + element + ">");
    }
    /// Moves to where a node in `field` starts; returns the containerField to write, if any.
    std::string nodeInsertPoint(std::string_view field, const NodeShape& child) {
        if (frames_.empty() || frames_.back().kind == Kind::body) {
            line();
            return {};
        }
        Frame& frame = frames_.back();
        if (frame.openValue.empty() || frame.valueName != field) {
            if (frame.shape.proto) {
                line();
                frame.valueName = field;
                frame.valueEmpty = false;
                write("<fieldValue" + attribute("name", field, {}) + ">");
                frame.openValue = "fieldValue";
            } else {
                line();
                return containerField(frame.shape, field, child);
            }
        } else if (frame.valueEmpty) {
            write(">");
            frame.valueEmpty = false;
        }
        newLine();
        return {};
    }
    /// A containerField that all readers choose by themselves need not be written. For a PROTO instance that is
    /// `children`, whatever node it stands for, since not all readers look into the PROTO. For a node of unknown type
    /// nothing better is known.
    std::string containerField(const NodeShape& parent, std::string_view field, const NodeShape& child) const {
        constexpr std::string_view kUnsaid = "children";
        if (child.unknown && field == kUnsaid) return {};
        const NodeType* type = child.standsFor();
        const FieldRef target = findField(parent, field);
        const std::string_view usual = type ? std::string_view(type->containerField) : kUnsaid;
        const bool chosen = field == usual && target && accepts(target, type) && (!child.proto || usual == kUnsaid);
        return chosen ? "" : std::string(spelled(parent, field));
    }
    /// The field's name in the version that is written.
    std::string_view spelled(const NodeShape& shape, std::string_view field) const {
        const std::string_view old = shape.type ? formerName(*shape.type, field, version_) : std::string_view();
        return old.empty() ? field : old;
    }
    void noteFirst(const NodeShape& shape) {
        if (frames_.empty() || frames_.back().kind != Kind::body || frames_.back().proto->hasBody) return;
        frames_.back().proto->hasBody = true;
        frames_.back().proto->primary = shape.standsFor();
    }

    // ---- attributes
    std::string declaration(const FieldDeclaration& field, SourceLocation where) {
        return "<field" + attribute("accessType", accessWord(field.access, false), where) +
               attribute("type", fieldTypeName(field.type, field.custom.get()), where) +
               attribute("name", field.name, where) + (field.about ? describe(*field.about, where) : std::string());
    }
    std::string describe(const Documentation& about, SourceLocation where) {
        std::string result;
        if (!about.appinfo.empty()) result += attribute("appinfo", about.appinfo, where);
        if (!about.documentation.empty()) result += attribute("documentation", about.documentation, where);
        return result;
    }
    std::string unknownName(std::string_view type, SourceLocation where) {
        std::string name = spellName(type, Spelling::element);
        if (name != type)
            diagnostics_.warning(where, "'" + std::string(type) + "' is no name in XML; written as " + name);
        return name;
    }
    std::string attribute(std::string_view name, std::string_view text, SourceLocation where) {
        std::string result = " " + std::string(name) + "='";
        escape(result, text, where, true);
        return result + "'";
    }
    /// Whether its text may have characters that have a meaning in XML.
    static bool isText(const Value& value) {
        return sf(value.type()) == FieldType::SFString || sf(value.type()) == FieldType::SFCustom;
    }
    std::string valueAttribute(std::string_view name, const Value& value, SourceLocation where) {
        std::string text;
        appendWrapped(text, value, TextSyntax::xml, spaces(indent() + 1));
        std::string result = " " + std::string(name) + "='";
        if (isText(value))
            escape(result, text, where, true);
        else
            result += text;
        return result + "'";
    }
    void escape(std::string& out, std::string_view text, SourceLocation where, bool attribute) {
        for (const char c : text) {
            switch (c) {
                case '&':
                    out += "&amp;";
                    break;
                case '<':
                    out += "&lt;";
                    break;
                case '>':
                    out += "&gt;";
                    break;
                case '\'':
                    out += attribute ? "&apos;" : "'";
                    break;
                case '\n':
                    out += attribute ? "&#10;" : "\n";
                    break;
                case '\t':
                    out += "&#9;";
                    break;
                case '\r':
                    out += "&#13;";
                    break;
                default:
                    if (static_cast<unsigned char>(c) < 0x20) {
                        diagnostics_.warning(where, "a control character cannot be written in XML; U+FFFD is");
                        out += "\xEF\xBF\xBD";
                    } else {
                        out += c;
                    }
            }
        }
    }
    /// The source text of a Script, if it can stand in CDATA: the last url, in several lines.
    bool keepSource(const Value& url) {
        const Array<String>& urls = url.as<Array<String>>();
        if (urls.empty()) return false;
        const std::string_view text = urls.back();
        const bool source = text.find_first_not_of(" \t\r\n") == 0 && programInUrl(text);
        const bool spelled = std::ranges::all_of(
            text, [](char c) { return static_cast<unsigned char>(c) >= 0x20 || c == '\n' || c == '\t'; });
        Frame& frame = frames_.back();
        if (!source || !spelled || text.find('\n') == text.npos || frame.shape.type->name != "Script") return false;
        if (urls.size() > 1) {
            Array<String> others = urls;
            others.erase(urls.size() - 1);
            *frame.gap += valueAttribute("url", Value(std::move(others)), {});
        }
        frame.source = urls.back();
        return true;
    }
    void writeSource(std::string_view text) {
        write("<![CDATA[");
        std::size_t from = 0;
        for (std::size_t end = text.find("]]>"); end != text.npos; end = text.find("]]>", from)) {
            write(text.substr(from, end + 2 - from));
            write("]]><![CDATA[");
            from = end + 2;
        }
        write(text.substr(from));
        write("]]>");
    }

    TextSink sink_;
    Diagnostics& diagnostics_;
    Waiting waiting_;
    Rope pieces_;
    std::size_t openGaps_ = 0;
    Where field_ = Where::root;
    std::string version_;  // of the document written
    bool valuesFirst_ = false;
    std::size_t protos_ = 0;  // open
    std::string about_;       // attributes of the PROTO or EXTERNPROTO that comes next
    Units units_;
    ReaderTypes types_;
    UnknownUses uses_;
    std::vector<Frame> frames_;
};

}  // namespace

std::unique_ptr<DocumentHandler> makeXmlWriter(TextSink sink, Diagnostics& diagnostics) {
    return std::make_unique<XmlWriter>(std::move(sink), diagnostics);
}

}  // namespace rtsg::detail
