// ClassicVRML and VRML97. An MFNode field stays open as one list from its first node to the end of its node; whatever
// else comes meanwhile in that node is held back and put behind the list, since a field may be given once only.
#include <algorithm>
#include <array>
#include <list>
#include <set>

#include "commands/units.h"
#include "commands/versions.h"
#include "text/number_text.h"
#include "writer_common.h"

namespace rtsg::detail {

namespace {

class ClassicWriter final : public DocumentHandler {
  public:
    ClassicWriter(TextSink sink, Diagnostics& diagnostics, bool vrml97)
        : sink_(std::move(sink)), diagnostics_(diagnostics), vrml97_(vrml97) {}

    void beginDocument(const DocumentHeader& header) override {
        if (vrml97_) {
            text_ = "#VRML V2.0 utf8\n";
            return;
        }
        version_ = x3dVersion(header);
        text_ = "#X3D V" + version_ + " utf8\n";
        text_ += "PROFILE " + name(header.profile.empty() ? "Full" : header.profile, {}) + "\n";
    }
    void endDocument() override { flush(); }

    void component(std::string_view component, int level, SourceLocation) override {
        if (vrml97_) return cannot({}, "COMPONENT");
        statement("COMPONENT " + name(component, {}) + ":" + std::to_string(level));
    }
    void meta(std::string_view metaName, std::string_view content, SourceLocation) override {
        if (vrml97_) return cannot({}, "META");
        statement("META " + printFieldText(Value(String(metaName))) + " " + printFieldText(Value(String(content))));
    }
    void unit(std::string_view category, std::string_view unitName, double factor, SourceLocation) override {
        if (vrml97_) return cannot({}, "UNIT");
        units_.set(category, factor);
        statement("UNIT " + name(category, {}) + " " + name(unitName, {}) + " " + printFieldText(Value(factor)));
    }

    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation where) override {
        NodeShape shape = types_.find(type);
        if (shape.type && declaresFields(*shape.type)) shape.own = std::make_shared<DeclaredFields>();
        if (!def.empty()) types_.define(def, shape);
        if (vrml97_ && shape.type && !isInVersion(type, version_) && notInVrml97_.insert(std::string(type)).second)
            diagnostics_.warning(where, std::string(type) + " is no node of VRML97 (it came with X3D " +
                                            versionText(shape.type->since) + "); browsers of VRML97 will not read it");
        const InsertPoint insertPoint = nodeInsertPoint(field, where);
        if (!def.empty()) *insertPoint.text += "DEF " + name(def, where) + " ";
        *insertPoint.text += shape.unknown ? name(type, where) : std::string(type);
        *insertPoint.text += " {";
        frames_.push_back({.kind = Kind::node,
                           .text = insertPoint.text,
                           .indent = insertPoint.indent + 1,
                           .shape = std::move(shape)});
    }
    void endNode(SourceLocation) override { end("}"); }
    void useNode(std::string_view def, std::string_view field, SourceLocation where) override {
        *nodeInsertPoint(field, where).text += "USE " + name(def, where);
        statementEnd();
    }

    void setField(std::string_view field, Value value, SourceLocation where) override {
        if (!units_.areStandard()) units_.fromStandard(findField(frames_.back().shape, field).definition, value);
        const InsertPoint insertPoint = line();
        *insertPoint.text += fieldName(frames_.back().shape, field, where) + " ";
        std::function<void()> full;
        if (insertPoint.text == &text_) full = [this] { flush(); };
        appendWrapped(*insertPoint.text, value, TextSyntax::classicVrml, spaces(insertPoint.indent + 1), full);
        flushIfFull();
    }
    void declareField(const FieldDeclaration& field, std::optional<Value> value, SourceLocation where) override {
        if (value) units_.fromStandard(nullptr, *value);
        // On lines of its own: a comment would go into the list of the field before.
        if (field.about && !field.about->appinfo.empty()) commentLines(line(), "appinfo: " + field.about->appinfo);
        if (field.about && !field.about->documentation.empty())
            commentLines(line(), "documentation: " + field.about->documentation);
        const InsertPoint insertPoint = line();
        Frame& frame = frames_.back();
        if (frame.shape.own) frame.shape.own->add(field);
        if (frame.proto) frame.proto->fields.add(field);
        *insertPoint.text += declaration(field, where);
        frame.declared = std::make_unique<Declared>(Declared{field, std::move(value), insertPoint});
    }
    void isConnection(std::string_view nodeField, std::string_view protoField, SourceLocation where) override {
        Frame& frame = frames_.back();
        if (frame.declared && frame.declared->field.name == nodeField) {
            *frame.declared->insertPoint.text += " IS " + name(protoField, where);
            frame.declared.reset();
            return;
        }
        *line().text += fieldName(frame.shape, nodeField, where) + " IS " + name(protoField, where);
    }

    void beginProto(std::string_view protoName, SourceLocation where) override {
        const InsertPoint insertPoint = protoInsertPoint();
        *insertPoint.text += "PROTO " + name(protoName, where) + " [";
        frames_.push_back(
            {.kind = Kind::interface, .text = insertPoint.text, .indent = insertPoint.indent + 1, .shape = {}});
        frames_.back().proto = std::make_shared<ProtoType>();
        frames_.back().proto->name = protoName;
    }
    void beginProtoBody(SourceLocation) override {
        Frame& frame = frames_.back();
        finish(frame);
        if (frame.filled) newLine(*frame.text, frame.indent - 1);
        *frame.text += "] {";
        frame.filled = false;
        frame.kind = Kind::body;
        types_.pushScope();
    }
    void endProto(SourceLocation) override {
        const std::shared_ptr<ProtoType> proto = frames_.back().proto;
        end("}");
        types_.popScope();
        types_.declareProto(proto);
    }
    void externProto(std::string_view protoName, const std::vector<FieldDeclaration>& fields,
                     const std::vector<std::string>& url, SourceLocation where) override {
        auto proto = std::make_shared<ProtoType>();
        proto->name = protoName;
        const InsertPoint insertPoint = protoInsertPoint();
        *insertPoint.text += "EXTERNPROTO " + name(protoName, where) + " [";
        for (const FieldDeclaration& field : fields) {
            newLine(*insertPoint.text, insertPoint.indent + 1);
            if (field.about && !field.about->appinfo.empty()) {
                commentLines({insertPoint.text, insertPoint.indent + 1}, "appinfo: " + field.about->appinfo);
                newLine(*insertPoint.text, insertPoint.indent + 1);
            }
            if (field.about && !field.about->documentation.empty()) {
                commentLines({insertPoint.text, insertPoint.indent + 1},
                             "documentation: " + field.about->documentation);
                newLine(*insertPoint.text, insertPoint.indent + 1);
            }
            *insertPoint.text += declaration(field, where);
            proto->fields.add(field);
        }
        if (!fields.empty()) newLine(*insertPoint.text, insertPoint.indent);
        *insertPoint.text += "] ";
        Array<String> urls;
        for (const std::string& one : url) urls.push_back(one);
        appendWrapped(*insertPoint.text, Value(std::move(urls)), TextSyntax::classicVrml,
                      spaces(insertPoint.indent + 1));
        types_.declareProto(proto);
        statementEnd();
    }

    void route(std::string_view fromNode, std::string_view fromField, std::string_view toNode, std::string_view toField,
               SourceLocation where) override {
        const auto end = [&](std::string_view node, std::string_view field) {
            const NodeShape* shape = types_.defined(node);
            return name(node, where) + "." + (shape ? fieldName(*shape, field, where) : name(field, where));
        };
        statement("ROUTE " + end(fromNode, fromField) + " TO " + end(toNode, toField));
    }
    void importNode(std::string_view inlineDef, std::string_view exported, std::string_view local,
                    SourceLocation where) override {
        if (vrml97_) return cannot(where, "IMPORT");
        statement("IMPORT " + name(inlineDef, where) + "." + name(exported, where) + " AS " + name(local, where));
    }
    void exportNode(std::string_view local, std::string_view exported, SourceLocation where) override {
        if (vrml97_) return cannot(where, "EXPORT");
        statement("EXPORT " + name(local, where) + " AS " + name(exported, where));
    }

    void comment(std::string_view text, SourceLocation) override {
        // Behind a declaration that waits for its nodes, in the open list, or on lines of its own.
        Frame* frame = frames_.empty() ? nullptr : &frames_.back();
        if (frame && frame->declared && !frame->declared->value &&
            sf(frame->declared->field.type) == FieldType::SFNode) {
            commentLines(newLine(*frame->declared->insertPoint.text, frame->indent), text);
            newLine(*frame->declared->insertPoint.text, frame->indent);
        } else if (frame && !frame->declared && frame->declaredList) {
            commentLines(newLine(*frame->declaredList, frame->indent + 1), text);
        } else if (frame && !frame->declared && !frame->deferred.empty()) {
            Deferred& last = frame->deferred.back();
            commentLines(newLine(last.text, frame->indent + (last.list.empty() ? 0 : 1)), text);
        } else if (frame && !frame->declared && !frame->openList.empty()) {
            commentLines(newLine(*frame->text, frame->indent + 1), text);
        } else {
            commentLines(line(), text);
            statementEnd();
        }
    }
    /// There is no other place for it than a comment.
    void documentation(const Documentation& about, SourceLocation where) override {
        if (!about.appinfo.empty()) comment("appinfo: " + about.appinfo, where);
        if (!about.documentation.empty()) comment("documentation: " + about.documentation, where);
    }

  private:
    enum class Kind : std::uint8_t { node, interface, body };
    /// The text to which something is written, at the right column, and the indent of its line.
    struct InsertPoint {
        std::string* text;
        std::size_t indent;
    };
    struct Declared {
        FieldDeclaration field;
        std::optional<Value> value;
        InsertPoint insertPoint;
    };
    struct Deferred {
        std::string list;  // the MFNode field, or empty
        std::string text;
    };
    struct Frame {
        Kind kind;
        std::string* text;
        std::size_t indent;  // of the text between the braces
        NodeShape shape{};
        bool filled = false;                   // something stands there
        std::string* declaredList = nullptr;   // where the list of a declared field is open, until the next command
        std::string declaredField{};           // that field
        std::string openList{};                // the MFNode field whose list is open
        std::unique_ptr<Declared> declared{};  // written but for its value
        std::list<Deferred> deferred{};        // a list: its texts must not move
        std::shared_ptr<ProtoType> proto{};
    };

    // ---- places
    /// A new line in the innermost frame for anything but a node.
    InsertPoint line() {
        if (frames_.empty()) return {&text_, 0};
        Frame& frame = frames_.back();
        settle(frame);
        frame.filled = true;
        if (frame.openList.empty()) return newLine(*frame.text, frame.indent);
        if (frame.deferred.empty() || !frame.deferred.back().list.empty()) frame.deferred.emplace_back();
        return newLine(frame.deferred.back().text, frame.indent);
    }
    InsertPoint nodeInsertPoint(std::string_view field, SourceLocation where) {
        if (frames_.empty() || frames_.back().kind == Kind::body) return line();
        Frame& frame = frames_.back();
        if (frame.declared && frame.declared->field.name == field) {
            const InsertPoint insertPoint = frame.declared->insertPoint;
            const bool list = isMF(frame.declared->field.type);
            frame.declared.reset();
            *insertPoint.text += list ? " [" : " ";
            if (!list) return insertPoint;
            frame.declaredField = field;
            frame.declaredList = insertPoint.text;
        }
        if (frame.declaredList && frame.declaredField == field) return newLine(*frame.declaredList, frame.indent + 1);
        if (frame.openList == field) return newLine(*frame.text, frame.indent + 1);
        settle(frame);
        const FieldRef found = findField(frame.shape, field);
        if (!found || !isMF(found.type)) {
            const InsertPoint insertPoint = line();
            *insertPoint.text += fieldName(frame.shape, field, where) + " ";
            return insertPoint;
        }
        if (frame.openList.empty()) {
            const InsertPoint insertPoint = line();
            *insertPoint.text += fieldName(frame.shape, field, where) + " [";
            frame.openList = field;
            return newLine(*insertPoint.text, frame.indent + 1);
        }
        auto found2 = std::ranges::find(frame.deferred, field, &Deferred::list);
        if (found2 == frame.deferred.end()) {
            frame.deferred.push_back({std::string(field), {}});
            found2 = std::prev(frame.deferred.end());
            newLine(found2->text, frame.indent);
            found2->text += fieldName(frame.shape, field, where) + " [";
        }
        return newLine(found2->text, frame.indent + 1);
    }
    /// A list of nodes cannot hold a PROTO, and its instances must come behind it: the list ends, a second follows.
    InsertPoint protoInsertPoint() {
        if (!frames_.empty()) finish(frames_.back());
        return line();
    }
    InsertPoint newLine(std::string& text, std::size_t indent) {
        text += '\n';
        text.append(spaces(indent), ' ');
        return {&text, indent};
    }
    /// At the start of a line; two comments in a row have an empty line between them, or they would be one.
    void commentLines(InsertPoint insertPoint, std::string_view text) {
        if (commented_ == insertPoint.text && commentSize_ == sizeWithoutSpace(*insertPoint.text))
            newLine(*insertPoint.text, insertPoint.indent);
        for (std::size_t from = 0; from <= text.size();) {
            // A comment ends at a line feed or a carriage return.
            const std::size_t end = std::min(text.find_first_of("\r\n", from), text.size());
            if (from) newLine(*insertPoint.text, insertPoint.indent);
            *insertPoint.text += "# ";
            *insertPoint.text += text.substr(from, end - from);
            from = end + (text.substr(end, 2) == "\r\n" ? 2 : 1);
        }
        commented_ = insertPoint.text;
        commentSize_ = sizeWithoutSpace(*insertPoint.text);
    }
    static std::size_t sizeWithoutSpace(const std::string& text) { return text.find_last_not_of(" \n") + 1; }
    void statement(const std::string& words) {
        *line().text += words;
        statementEnd();
    }
    void statementEnd() {
        if (frames_.empty()) text_ += '\n';
        flushIfFull();
    }

    // ---- endings
    /// Completes a declaration that no node or connection followed, and the list of one that nodes followed.
    void settle(Frame& frame) {
        if (frame.declared) {
            const std::unique_ptr<Declared> declared = std::move(frame.declared);
            const Access access = declared->field.access;
            if (access == Access::initializeOnly || access == Access::inputOutput) {
                *declared->insertPoint.text += ' ';
                appendWrapped(
                    *declared->insertPoint.text,
                    declared->value ? *declared->value : zeroOf(declared->field.type, declared->field.custom.get()),
                    TextSyntax::classicVrml, spaces(declared->insertPoint.indent + 1));
            }
        }
        if (!frame.declaredList) return;
        newLine(*frame.declaredList, frame.indent);
        *frame.declaredList += ']';
        frame.declaredList = nullptr;
    }
    /// Ends the open list and writes the text that was held back.
    void finish(Frame& frame) {
        settle(frame);
        if (!frame.openList.empty()) {
            newLine(*frame.text, frame.indent);
            *frame.text += ']';
            frame.openList.clear();
        }
        for (const Deferred& deferred : frame.deferred) {
            *frame.text += deferred.text;
            if (deferred.list.empty()) continue;
            newLine(*frame.text, frame.indent);
            *frame.text += ']';
        }
        frame.deferred.clear();
    }
    void end(const char* bracket) {
        Frame& frame = frames_.back();
        finish(frame);
        if (frame.filled) newLine(*frame.text, frame.indent - 1);
        *frame.text += bracket;
        frames_.pop_back();
        statementEnd();
    }
    void flush() {
        if (commented_ == &text_) {
            if (commentSize_ != sizeWithoutSpace(text_)) commented_ = nullptr;
            commentSize_ = 0;
        }
        sink_(text_);
        text_.clear();
    }
    void flushIfFull() {
        if (text_.size() >= kFlushAt) flush();
    }

    // ---- words
    std::string declaration(const FieldDeclaration& field, SourceLocation where) {
        return std::string(accessWord(field.access, vrml97_)) + " " + fieldTypeName(field.type, field.custom.get()) +
               " " + name(field.name, where);
    }
    std::string fieldName(const NodeShape& shape, std::string_view field, SourceLocation where) {
        if (!shape.type) return name(field, where);
        if (vrml97_) noteVersion(*shape.type, field, where);
        const std::string_view old = formerName(*shape.type, field, version_);
        return old.empty() ? name(field, where) : std::string(old);
    }
    /// Says once which fields VRML97 does not have, of nodes that it has.
    void noteVersion(const NodeType& type, std::string_view field, SourceLocation where) {
        constexpr int vrml97 = 20;
        const FieldIndex index = type.findExact(field);
        if (type.since > vrml97 || index == kNoField || type.fields[index].since <= vrml97) return;
        const std::string both = type.name + "." + std::string(field);
        if (!notInVrml97_.insert(both).second) return;
        diagnostics_.warning(where, both + " is no field of VRML97 (it came with X3D " +
                                        versionText(type.fields[index].since) +
                                        "); browsers of VRML97 will not read it");
    }
    std::string name(std::string_view text, SourceLocation where) {
        std::string result = spellName(text, Spelling::classic);
        if (result != text)
            diagnostics_.warning(where, "'" + std::string(text) + "' is no name in ClassicVRML; written as " + result);
        return result;
    }
    void cannot(SourceLocation where, const std::string& what) {
        diagnostics_.warning(where, what + " cannot be written as VRML97 and is left out");
    }

    TextSink sink_;
    Diagnostics& diagnostics_;
    bool vrml97_;
    std::string version_ = "2.0";  // of the document written
    std::string text_;
    const std::string* commented_ = nullptr;  // the text that ended in a comment, when it was of this size
    std::size_t commentSize_ = 0;
    std::set<std::string> notInVrml97_;  // types that have been named
    Units units_;
    ReaderTypes types_;
    std::vector<Frame> frames_;
};

}  // namespace

std::unique_ptr<DocumentHandler> makeClassicWriter(TextSink sink, Diagnostics& diagnostics, bool vrml97) {
    return std::make_unique<ClassicWriter>(std::move(sink), diagnostics, vrml97);
}

}  // namespace rtsg::detail
