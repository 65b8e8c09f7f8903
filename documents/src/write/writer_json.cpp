// JSON. Members of an object may come in any order but each once, so what belongs to a node is gathered by member, in
// ropes, and a node of the top level goes out when it ends; long lists of numbers become text then.
#include <algorithm>
#include <list>
#include <set>
#include <utility>

#include <rtsg/core/web_address.h>

#include "commands/units.h"
#include "writer_common.h"
#include "writer_waiting.h"

namespace rtsg::detail {

namespace {

std::string inQuotes(std::string_view text) {
    return printFieldText(Value(String(text)), TextSyntax::json);
}

/// Numbers of every MF type stand in one flat array. `full` is called every so often within it, and may empty `text`.
void appendValue(std::string& text, const Value& value, const std::function<void()>& full = {}) {
    if (!isMF(value.type())) return appendFieldText(text, value, TextSyntax::json);
    text += '[';
    const bool numbers = withNumbers(value, [&](const auto* first, std::size_t count, std::size_t) {
        constexpr std::size_t maximum = 64;  // numbers at a time
        char piece[maximum * (kLongestNumber + 1)];
        for (std::size_t i = 0; i < count;) {
            char* end = piece;
            for (const std::size_t stop = std::min(i + maximum, count); i < stop; ++i) {
                if (i) *end++ = ',';
                end = printNumber(end, first[i], TextSyntax::json);
            }
            text.append(piece, end);
            if (full && text.size() >= kFlushAt) full();
        }
    });
    for (std::size_t i = 0, size = numbers ? 0 : elementsIn(value); i < size; ++i) {
        if (i) text += ',';
        std::string element;
        appendArrayElement(element, value, i, TextSyntax::json);
        if (element.starts_with('['))
            text.append(element, 1, element.size() - 2);
        else
            text += element;
    }
    text += ']';
}
std::string valueText(const Value& value) {
    std::string text;
    appendValue(text, value);
    return text;
}

class JsonWriter final : public DocumentHandler {
  public:
    JsonWriter(TextSink sink, Diagnostics& diagnostics)
        : sink_(std::move(sink)),
          diagnostics_(diagnostics),
          waiting_([](std::string& text, const WaitingText& piece, const std::function<void()>& full) {
              appendValue(text, piece.numbers, full);
          }) {}

    void beginDocument(const DocumentHeader& header) override {
        version_ = x3dVersion(header);
        text_ = "{\"X3D\":{\"encoding\":\"UTF-8\",\"@profile\":" +
                inQuotes(header.profile.empty() ? "Full" : header.profile) + ",\"@version\":" + inQuotes(version_);
    }
    void endDocument() override {
        openScene();
        text_ += "\n]}}}\n";
        flush();
        uses_.report(diagnostics_);
    }
    void component(std::string_view name, int level, SourceLocation) override {
        head(components_, "{\"@name\":" + inQuotes(name) + ",\"@level\":" + std::to_string(level) + "}");
    }
    void meta(std::string_view name, std::string_view content, SourceLocation) override {
        head(metas_, "{\"@name\":" + inQuotes(name) + ",\"@content\":" + inQuotes(content) + "}");
    }
    void unit(std::string_view category, std::string_view name, double factor, SourceLocation) override {
        units_.set(category, factor);
        head(unitItems_, "{\"@category\":" + inQuotes(category) + ",\"@name\":" + inQuotes(name) +
                             ",\"@conversionFactor\":" + valueText(Value(factor)) + "}");
    }

    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation) override {
        Frame frame{};
        frame.shape = types_.find(type);
        if (frame.shape.type && declaresFields(*frame.shape.type)) frame.shape.own = std::make_shared<DeclaredFields>();
        if (!def.empty()) types_.define(def, frame.shape);
        frame.field = field;
        frame.element = frame.shape.proto     ? "ProtoInstance"
                        : frame.shape.unknown ? spellName(type, Spelling::element)
                                              : std::string(type);
        if (frame.shape.proto) attribute(frame, "name", inQuotes(type));
        if (!def.empty()) attribute(frame, "DEF", inQuotes(def));
        frames_.push_back(std::move(frame));
    }
    void endNode(SourceLocation) override {
        Frame frame = std::move(frames_.back());
        frames_.pop_back();
        const std::string field = std::move(frame.field);
        putItem(field, finished(std::move(frame)));
    }
    void useNode(std::string_view def, std::string_view field, SourceLocation where) override {
        const NodeShape* defined = types_.defined(def);
        if (!defined) uses_.use(def, where);
        const bool instance = defined && defined->proto;
        const std::string_view name = instance ? "ProtoInstance" : defined ? defined->name() : "Group";
        const std::string element =
            defined && defined->unknown ? spellName(name, Spelling::element) : std::string(name);
        Frame frame{};
        frame.element = element;
        if (instance) attribute(frame, "name", inQuotes(defined->proto->name));
        attribute(frame, "USE", inQuotes(def));
        putItem(field, finished(std::move(frame)));
    }
    void setField(std::string_view field, Value value, SourceLocation) override {
        Frame& frame = frames_.back();
        const bool nodes = sf(value.type()) == FieldType::SFNode;
        if (!units_.areStandard()) units_.fromStandard(findField(frame.shape, field).definition, value);
        if (frame.shape.proto) {
            frame.values.push_back({std::string(field), "{\"@name\":" + inQuotes(field), {}});
            if (!nodes) frame.values.back().text += ",\"@value\":" + valueText(value);
            return;
        }
        if (nodes) return;  // NULL and the empty list are the default of a field of nodes
        if (frame.shape.unknown) {
            const std::string name = spellName(field, Spelling::attribute);
            if (frame.unknownGiven.insert(name).second) attribute(frame, name, valueText(value));
            return;
        }
        if (field == "url" && frame.element == "Script") return source(frame, value.as<Array<String>>());
        beginAttribute(frame, spelled(frame.shape, field));
        if (!isLongList(value)) return appendValue(frame.attributes, value);
        WaitingText piece(std::exchange(frame.attributes, {}));
        piece.numbers = std::move(value);
        waiting_.add(frame.given, std::move(piece));
    }
    void declareField(const FieldDeclaration& field, std::optional<Value> value, SourceLocation) override {
        if (value) units_.fromStandard(nullptr, *value);
        Frame& frame = frames_.back();
        if (frame.shape.own) frame.shape.own->add(field);
        if (frame.proto) frame.proto->fields.add(field);
        frame.declarations.push_back({field.name, declaration(field), {}});
        if (value && sf(field.type) != FieldType::SFNode)
            frame.declarations.back().text += ",\"@value\":" + valueText(*value);
    }
    void isConnection(std::string_view nodeField, std::string_view protoField, SourceLocation) override {
        add(frames_.back(), "connect", Many::yes,
            Rope{"{\"@nodeField\":" + inQuotes(nodeField) + ",\"@protoField\":" + inQuotes(protoField) + "}"});
    }

    void beginProto(std::string_view name, SourceLocation) override {
        Frame frame{};
        frame.element = "ProtoDeclare";
        frame.proto = std::make_shared<ProtoType>();
        frame.proto->name = name;
        attribute(frame, "name", inQuotes(name));
        frame.attributes += described(std::exchange(about_, {}));
        frames_.push_back(std::move(frame));
    }
    void beginProtoBody(SourceLocation) override {
        frames_.back().inBody = true;
        types_.pushScope();
    }
    void endProto(SourceLocation) override {
        Frame frame = std::move(frames_.back());
        frames_.pop_back();
        types_.popScope();
        types_.declareProto(frame.proto);
        putDeclaration(finished(std::move(frame)));
    }
    void externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                     const std::vector<std::string>& url, SourceLocation) override {
        Frame frame{};
        frame.element = "ExternProtoDeclare";
        auto proto = std::make_shared<ProtoType>();
        proto->name = name;
        attribute(frame, "name", inQuotes(name));
        frame.attributes += described(std::exchange(about_, {}));
        Array<String> urls;
        for (const std::string& one : url) urls.push_back(one);
        attribute(frame, "url", valueText(Value(std::move(urls))));
        for (const FieldDeclaration& field : fields) {
            frame.declarations.push_back({field.name, declaration(field), {}});
            proto->fields.add(field);
        }
        types_.declareProto(proto);
        putDeclaration(finished(std::move(frame)));
    }
    void route(std::string_view fromNode, std::string_view fromField, std::string_view toNode, std::string_view toField,
               SourceLocation) override {
        statement("ROUTE",
                  {{"fromNode", fromNode}, {"fromField", fromField}, {"toNode", toNode}, {"toField", toField}});
    }
    void importNode(std::string_view inlineDef, std::string_view exported, std::string_view local,
                    SourceLocation) override {
        uses_.import(local);
        statement("IMPORT", {{"inlineDEF", inlineDef}, {"importedDEF", exported}, {"AS", local}});
    }
    void exportNode(std::string_view local, std::string_view exported, SourceLocation) override {
        statement("EXPORT", {{"localDEF", local}, {"AS", exported}});
    }

    /// Writes a comment into a list, if there is one that may hold it, or else as a member of the open object.
    void comment(std::string_view text, SourceLocation) override {
        if (frames_.empty() && !sceneOpen_) {
            comments_ += (comments_.empty() ? "" : ",\n  ") + inQuotes(text);
            return;
        }
        if (frames_.empty()) return putItem({}, Rope{"{\"#comment\":" + inQuotes(text) + "}"});
        Frame& frame = frames_.back();
        if (frame.inBody) return putItem({}, Rope{"{\"#comment\":" + inQuotes(text) + "}"});
        const auto list = std::ranges::find(frame.members, "-children", &Member::key);
        if (list != frame.members.end() && list->many == Many::yes)
            append(list->items, Rope{"{\"#comment\":" + inQuotes(text) + "}"});
        else
            add(frame, "#comment", Many::no, Rope{inQuotes(text)});
    }
    void documentation(const Documentation& about, SourceLocation) override { about_ = about; }

  private:
    enum class Many : bool { no, yes };
    struct Member {
        std::string key;
        Many many;
        Rope items;
    };
    struct Declaration {
        std::string name, text;
        Rope nodes;
    };
    struct Frame {
        std::string element, field, attributes;
        Rope given;  // attributes that come before those
        NodeShape shape;
        std::vector<Member> members;
        std::vector<Declaration> declarations;
        std::vector<Declaration> values;  // of a PROTO instance's fields
        std::shared_ptr<ProtoType> proto;
        bool inBody = false;
        std::set<std::string> unknownGiven;  // attributes of a node of unknown type
    };

    static void beginAttribute(Frame& frame, std::string_view name) {
        if (!frame.attributes.empty() || !frame.given.empty()) frame.attributes += ',';
        frame.attributes += "\"@";
        frame.attributes += name;
        frame.attributes += "\":";
    }
    static void attribute(Frame& frame, std::string_view name, const std::string& text) {
        beginAttribute(frame, name);
        frame.attributes += text;
    }
    static std::string declaration(const FieldDeclaration& field) {
        return "{\"@accessType\":" + inQuotes(accessWord(field.access, false)) +
               ",\"@type\":" + inQuotes(fieldTypeName(field.type, field.custom.get())) +
               ",\"@name\":" + inQuotes(field.name) + (field.about ? described(*field.about) : std::string());
    }
    static std::string described(const Documentation& about) {
        std::string result;
        if (!about.appinfo.empty()) result += ",\"@appinfo\":" + inQuotes(about.appinfo);
        if (!about.documentation.empty()) result += ",\"@documentation\":" + inQuotes(about.documentation);
        return result;
    }
    void append(Rope& items, Rope&& item) {
        if (!items.empty()) waiting_.add(items, WaitingText(","));
        waiting_.add(items, std::move(item));
    }
    void add(Frame& frame, std::string_view key, Many many, Rope&& item) {
        auto found = std::ranges::find(frame.members, key, &Member::key);
        if (found == frame.members.end())
            found = frame.members.insert(found, {std::string(key), many, {}});
        else if (many == Many::no)
            found->many = Many::yes;  // more than its field takes: kept all the same
        append(found->items, std::move(item));
    }
    /// A node or statement has ended: puts it into its place in the open one.
    void putItem(std::string_view field, Rope&& item) {
        if (frames_.empty()) {
            openScene();
            text_ += any_ ? ",\n" : "\n";
            any_ = true;
            for (WaitingText& piece : item) {
                if (!piece.isClosed()) {
                    text_ += std::exchange(piece.text, {});
                    if (text_.size() > kFlushAt) flush();
                    continue;
                }
                flush();
                if (!waiting_.send(piece, sink_))
                    diagnostics_.error({}, "what waited in a file without a name cannot be read: text is missing here");
            }
            return waiting_.clear();
        }
        Frame& frame = frames_.back();
        if (field.empty()) return add(frame, frame.proto ? "ProtoBody" : "-children", Many::yes, std::move(item));
        if (!frame.declarations.empty() && frame.declarations.back().name == field)
            return append(frame.declarations.back().nodes, std::move(item));
        const FieldRef found = findField(frame.shape, field);
        if (frame.shape.proto) {
            auto value = std::ranges::find(frame.values, field, &Declaration::name);
            if (value == frame.values.end())
                value = frame.values.insert(value, {std::string(field), "{\"@name\":" + inQuotes(field), {}});
            return append(value->nodes, std::move(item));
        }
        add(frame, "-" + std::string(spelled(frame.shape, field)), found && !isMF(found.type) ? Many::no : Many::yes,
            std::move(item));
    }
    /// A list that was begun before may have instances: the list of what stands in no field comes before those.
    void putDeclaration(Rope item) {
        if (!frames_.empty() && !frames_.back().proto) {
            std::vector<Member>& members = frames_.back().members;
            if (std::ranges::find(members, "-children", &Member::key) == members.end())
                members.insert(members.begin(), {"-children", Many::yes, {}});
        }
        putItem({}, std::move(item));
    }
    /// The field's name in the version that is written.
    std::string_view spelled(const NodeShape& shape, std::string_view field) const {
        const std::string_view old = shape.type ? formerName(*shape.type, field, version_) : std::string_view();
        return old.empty() ? field : old;
    }
    /// `{"Type":{...}}`
    Rope finished(Frame&& frame) {
        Rope rope{"{" + inQuotes(frame.element) + ":{"};
        bool first = frame.attributes.empty() && frame.given.empty();
        waiting_.add(rope, std::move(frame.given));
        waiting_.add(rope, WaitingText(std::move(frame.attributes)));
        const auto member = [&](const std::string& opening, Rope&& items, const char* closing) {
            waiting_.add(rope, WaitingText((first ? "" : ",") + opening));
            first = false;
            waiting_.add(rope, std::move(items));
            waiting_.add(rope, WaitingText(closing));
        };
        const auto declared = [this](std::vector<Declaration>& declarations) {
            Rope items;
            for (Declaration& declaration : declarations) {
                Rope item{std::move(declaration.text)};
                if (!declaration.nodes.empty()) {
                    waiting_.add(item, WaitingText(",\"-children\":["));
                    waiting_.add(item, std::move(declaration.nodes));
                    waiting_.add(item, WaitingText("]"));
                }
                waiting_.add(item, WaitingText("}"));
                append(items, std::move(item));
            }
            return items;
        };
        const auto take = [&](std::string_view key) {
            const auto found = std::ranges::find(frame.members, key, &Member::key);
            return found == frame.members.end() ? Rope() : std::move(found->items);
        };
        // A comment within the interface is written before it, since a reader would otherwise find it in the body.
        if (frame.proto)
            for (Member& one : frame.members)
                if (one.key == "#comment") {
                    const bool many = one.many == Many::yes;
                    member(many ? "\"#comment\":[" : "\"#comment\":", std::move(one.items), many ? "]" : "");
                    one.items.clear();
                }
        const bool proto = frame.proto != nullptr;
        if (!frame.declarations.empty())
            member(proto ? "\"ProtoInterface\":{\"field\":[" : "\"field\":[", declared(frame.declarations),
                   proto ? "]}" : "]");
        // Behind fields of a node's own, which no reader knows before.
        if (Rope connections = take("connect"); !connections.empty())
            member("\"IS\":{\"connect\":[", std::move(connections), "]}");
        if (proto) member("\"ProtoBody\":{\"-children\":[", take("ProtoBody"), "]}");
        if (!frame.values.empty()) member("\"fieldValue\":[", declared(frame.values), "]");
        for (Member& one : frame.members) {
            if (one.items.empty() || (one.key[0] != '-' && one.key[0] != '#')) continue;
            const bool many = one.many == Many::yes;
            member(inQuotes(one.key) + (many ? ":[" : ":"), std::move(one.items), many ? "]" : "");
        }
        waiting_.add(rope, WaitingText("}}"));
        return rope;
    }
    void statement(const char* name, std::initializer_list<std::pair<std::string_view, std::string_view>> attributes) {
        Frame frame{};
        frame.element = name;
        for (const auto& [key, text] : attributes) attribute(frame, key, inQuotes(text));
        putItem({}, finished(std::move(frame)));
    }
    /// The last url of a Script, if it is source text, is written line by line.
    void source(Frame& frame, const Array<String>& urls) {
        const std::string_view last = urls.empty() ? std::string_view() : urls.back().view();
        const bool isSource = last.find_first_not_of(" \t\r\n") == 0 && programInUrl(last);
        Array<String> others = urls;
        if (isSource) others.resize(urls.size() - 1);
        if (!isSource || !others.empty()) attribute(frame, "url", valueText(Value(std::move(others))));
        if (!isSource) return;
        std::size_t from = 0;
        for (std::size_t end = last.find('\n'); from <= last.size(); end = last.find('\n', from)) {
            end = std::min(end, last.size());
            add(frame, "#sourceCode", Many::yes, Rope{inQuotes(last.substr(from, end - from))});
            from = end + 1;
        }
    }
    void head(std::string& list, const std::string& item) {
        if (sceneOpen_) {
            diagnostics_.warning({}, "a head statement behind the first node cannot be written in JSON");
            return;
        }
        if (!list.empty()) list += ",\n  ";
        list += item;
    }
    void openScene() {
        if (sceneOpen_) return;
        sceneOpen_ = true;
        std::string head;
        const auto list = [&](const char* key, const std::string& items) {
            if (!items.empty()) head += (head.empty() ? "\n" : ",\n") + inQuotes(key) + ":[\n  " + items + "]";
        };
        list("#comment", comments_);
        list("component", components_);
        list("unit", unitItems_);
        list("meta", metas_);
        if (!head.empty()) text_ += ",\n\"head\":{" + head + "}";
        text_ += ",\n\"Scene\":{\"-children\":[";
    }
    void flush() {
        sink_(text_);
        text_.clear();
    }

    TextSink sink_;
    Diagnostics& diagnostics_;
    Waiting waiting_;
    std::string version_, text_, components_, unitItems_, metas_, comments_;
    Documentation about_;  // of the PROTO or EXTERNPROTO that comes next
    bool sceneOpen_ = false, any_ = false;
    Units units_;
    ReaderTypes types_;
    UnknownUses uses_;
    std::vector<Frame> frames_;
};

}  // namespace

std::unique_ptr<DocumentHandler> makeJsonWriter(TextSink sink, Diagnostics& diagnostics) {
    return std::make_unique<JsonWriter>(std::move(sink), diagnostics);
}

}  // namespace rtsg::detail
