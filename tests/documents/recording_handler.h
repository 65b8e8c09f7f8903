// A DocumentHandler that writes down each command as one line, and checks that they nest as the contract says.
#pragma once

#include <string>
#include <vector>

#include <rtsg/core/field_text.h>
#include <rtsg/documents/document_handler.h>

namespace rtsg::test {

class RecordingHandler final : public DocumentHandler {
  public:
    std::vector<std::string> lines;
    std::vector<SourceLocation> positions;  // of the command in the line of the same index
    DocumentHeader header;
    std::size_t nodes = 0, deepest = 0;
    std::string violation;  // the first breach of the contract
    bool quiet = false;     // count and check only

    std::string text() const {
        std::string all;
        for (const std::string& line : lines) all += line + "\n";
        return all;
    }
    bool complete() const { return began_ && ended_ && stack_.empty() && violation.empty(); }

    void beginDocument(const DocumentHeader& h) override {
        header = h;
        if (began_) breach("second beginDocument");
        began_ = true;
    }
    void endDocument() override {
        if (!stack_.empty()) breach("endDocument inside something");
        ended_ = true;
    }
    void component(std::string_view name, int level, SourceLocation w) override {
        say(w, "component ", name, " ", level);
    }
    void meta(std::string_view name, std::string_view content, SourceLocation w) override {
        say(w, "meta ", name, "=", content);
    }
    void unit(std::string_view category, std::string_view name, double factor, SourceLocation w) override {
        say(w, "unit ", category, " ", name, " ", printFieldText(Value(factor)));
    }
    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation w) override {
        say(w, "begin ", type, def.empty() ? "" : " DEF ", def, field.empty() ? "" : " in ", field);
        const bool inside = !stack_.empty() && stack_.back() != 'b';
        if (inside == field.empty()) breach("node " + std::string(type) + " with the wrong kind of place");
        holdNode();
        stack_ += 'n';
        ++nodes;
        deepest = std::max(deepest, stack_.size());
    }
    void endNode(SourceLocation w) override {
        if (!isInNode()) breach("endNode outside a node");
        if (!stack_.empty()) stack_.pop_back();
        say(w, "end");
    }
    void useNode(std::string_view def, std::string_view field, SourceLocation w) override {
        say(w, "use ", def, field.empty() ? "" : " in ", field);
        holdNode();
    }
    void setField(std::string_view name, Value value, SourceLocation w) override {
        if (!isInNode()) breach("setField outside a node");
        // In XML and JSON, programs and fields of PROTO instances may come behind nodes; importers have neither.
        const bool isImported = header.encoding == Encoding::classicVrml;
        if (header.valuesFirst && isImported && isInNode() && stack_.back() == 'N')
            breach("a value of " + std::string(name) + " behind a node");
        say(w, "set ", name, " ", info(value.type()).name, " ", quiet ? "" : printFieldText(value));
    }
    void declareField(const FieldDeclaration& f, std::optional<Value> value, SourceLocation w) override {
        if (stack_.empty() || stack_.back() == 'b') breach("declareField in the wrong place");
        say(w, "declare ", accessName(f.access), " ", info(f.type).name, " ", f.name, value ? " = " : "",
            value ? printFieldText(*value) : "");
    }
    void isConnection(std::string_view nodeField, std::string_view protoField, SourceLocation w) override {
        if (!isInNode()) breach("IS outside a node");
        say(w, "is ", nodeField, " ", protoField);
    }
    void beginProto(std::string_view name, SourceLocation w) override {
        say(w, "proto ", name);
        stack_ += 'i';
    }
    void beginProtoBody(SourceLocation w) override {
        if (stack_.empty() || stack_.back() != 'i') breach("beginProtoBody outside an interface");
        say(w, "body");
        if (!stack_.empty()) stack_.back() = 'b';
    }
    void endProto(SourceLocation w) override {
        if (stack_.empty() || stack_.back() != 'b') breach("endProto outside a body");
        if (!stack_.empty()) stack_.pop_back();
        say(w, "endproto");
    }
    void externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                     const std::vector<std::string>& url, SourceLocation w) override {
        std::string line = "externproto " + std::string(name);
        for (const FieldDeclaration& f : fields)
            line +=
                std::string(" [") + accessName(f.access) + " " + std::string(info(f.type).name) + " " + f.name + "]";
        for (const std::string& u : url) line += " '" + u + "'";
        say(w, line);
    }
    void route(std::string_view fromNode, std::string_view fromField, std::string_view toNode, std::string_view toField,
               SourceLocation w) override {
        say(w, "route ", fromNode, ".", fromField, " ", toNode, ".", toField);
    }
    void importNode(std::string_view inlineDef, std::string_view exported, std::string_view local,
                    SourceLocation w) override {
        say(w, "import ", inlineDef, ".", exported, " ", local);
    }
    void exportNode(std::string_view local, std::string_view exported, SourceLocation w) override {
        say(w, "export ", local, " ", exported);
    }

    static const char* accessName(Access access) {
        constexpr const char* names[] = {"initializeOnly", "inputOnly", "outputOnly", "inputOutput"};
        return names[static_cast<int>(access)];
    }

  private:
    /// A node is 'n' in the stack, and 'N' once it has nodes.
    bool isInNode() const { return !stack_.empty() && (stack_.back() == 'n' || stack_.back() == 'N'); }
    void holdNode() {
        if (isInNode()) stack_.back() = 'N';
    }
    static std::string str(std::string_view text) { return std::string(text); }
    static std::string str(int number) { return std::to_string(number); }
    template <class... Parts>
    void say(SourceLocation where, const Parts&... parts) {
        if (!began_ || ended_) breach("a command outside the document");
        if (quiet) return;
        std::string line;
        ((line += str(parts)), ...);
        lines.push_back(std::move(line));
        positions.push_back(where);
    }
    void breach(std::string what) {
        if (violation.empty()) violation = std::move(what);
    }

    std::string stack_;  // n node, i interface, b body
    bool began_ = false, ended_ = false;
};

}  // namespace rtsg::test
