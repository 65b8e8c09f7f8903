// An editor asks about documents that are being written. Source: Language Server Protocol 3.17.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <random>
#include <regex>

#include <fcntl.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include <rtsg/documents/language_server.h>
#include <rtsg/scripts/run_scripts.h>

#include "editor/answers.h"
#include "editor/document_words.h"
#include "editor/outline.h"
#include "editor/text_lines.h"
#include "support/temp_folder.h"
#include "test_paths.h"

namespace rtsg {
namespace {

using Json = nlohmann::json;
using testing::Contains;
using testing::HasSubstr;
using testing::IsSupersetOf;
using testing::Not;

/// An editor.
class Client {
  public:
    explicit Client(LanguageServerOptions options = {}, bool utf8 = false)
        : server(std::move(options), [this](std::string_view message) { sent.push_back(Json::parse(message)); }) {
        Json capabilities = Json::object();
        if (utf8) capabilities = {{"general", {{"positionEncodings", {"utf-8", "utf-16"}}}}};
        initialized = ask("initialize", {{"capabilities", capabilities}}).at("result");
        report("initialized", Json::object());
    }
    void say(Json message) {
        message["jsonrpc"] = "2.0";
        server.receive(message.dump());
    }
    void report(const char* method, Json params) { say({{"method", method}, {"params", std::move(params)}}); }
    /// The response.
    Json ask(const char* method, Json params) {
        say({{"id", ++number_}, {"method", method}, {"params", std::move(params)}});
        for (const Json& one : sent)
            if (one.value("id", Json()) == Json(number_)) return one;
        ADD_FAILURE() << "no answer to " << method;
        return {};
    }
    /// Opens or edits the document, and returns its faults.
    Json write(const std::string& text, const std::string& name = "file:///nowhere/a.x3dv") {
        uri = name;
        if (opened_.insert(name).second)
            report("textDocument/didOpen",
                   {{"textDocument", {{"uri", uri}, {"languageId", "x3d"}, {"version", 1}, {"text", text}}}});
        else
            report("textDocument/didChange",
                   {{"textDocument", {{"uri", uri}, {"version", 2}}}, {"contentChanges", {{{"text", text}}}}});
        text_ = text;
        return faults();
    }
    Json faults() {
        while (server.hasWork()) server.work();
        for (auto one = sent.rbegin(); one != sent.rend(); ++one)
            if (one->value("method", "") == "textDocument/publishDiagnostics" && one->at("params").at("uri") == uri)
                return one->at("params").at("diagnostics");
        return {};
    }
    /// Asks about the place that | marks in the text, which is then the document.
    Json at(const char* method, std::string marked, const std::string& name = "file:///nowhere/a.x3dv") {
        const std::size_t mark = marked.find('|');
        marked.erase(mark, 1);
        write(marked, name);
        const auto position = editor::TextLines(marked, false).positionOf(mark);
        return ask(method, {{"textDocument", {{"uri", uri}}},
                            {"position", {{"line", position.line}, {"character", position.character}}}})
            .at("result");
    }
    std::vector<std::string> proposals(const std::string& marked, const std::string& name = "file:///nowhere/a.x3dv") {
        std::vector<std::string> labels;
        const Json answer = at("textDocument/completion", marked, name);
        for (const Json& one : answer.at("items")) labels.push_back(one.at("label"));
        return labels;
    }
    /// The document as the first of the actions that are offered for the fault makes it.
    std::string mended(const Json& fault) {
        const Json actions = ask("textDocument/codeAction", {{"textDocument", {{"uri", uri}}},
                                                             {"range", fault.at("range")},
                                                             {"context", {{"diagnostics", {fault}}}}})
                                 .at("result");
        if (actions.empty()) return {};
        const Json edit = actions.at(0).at("edit").at("changes").at(uri).at(0);
        std::string text = text_;
        const std::size_t begin = offset(edit.at("range").at("start")), end = offset(edit.at("range").at("end"));
        return text.replace(begin, end - begin, edit.at("newText").get<std::string>());
    }
    std::string marked(const Json& range) const {
        const std::size_t begin = offset(range.at("start"));
        return text_.substr(begin, offset(range.at("end")) - begin);
    }
    std::size_t offset(const Json& position) const {
        return editor::TextLines(text_, false)
            .offsetOf(editor::TextPosition{position.at("line"), position.at("character")});
    }

    LanguageServer server;
    std::vector<Json> sent;
    Json initialized;
    std::string uri;

  private:
    int number_ = 0;
    std::set<std::string> opened_;
    std::string text_;
};

constexpr const char* kXml = "file:///nowhere/a.x3d";
std::string classic(const std::string& body) {
    return "#X3D V4.0 utf8\nPROFILE Immersive\n" + body;
}
std::string xml(const std::string& body) {
    return "<X3D version='4.0' profile='Immersive'>\n<Scene>\n" + body + "</Scene></X3D>";
}

TEST(LanguageServer, FaultsAreReportedWhileSomebodyTypes) {
    Client client;
    EXPECT_TRUE(client.write(classic("Transform { translation 1 2 3 }\n")).empty());
    const Json faults = client.write(classic("Group { }\nTransform { translaton 1 2 3 }\n"));
    ASSERT_EQ(faults.size(), 1U) << faults;
    EXPECT_THAT(faults[0].at("message").get<std::string>(), HasSubstr("did you mean translation?"));
    EXPECT_EQ(client.marked(faults[0].at("range")), "translaton");
    EXPECT_EQ(faults[0].at("severity"), 1);
    EXPECT_EQ(faults[0].at("code"), "parse");
    EXPECT_EQ(client.mended(faults[0]), classic("Group { }\nTransform { translation 1 2 3 }\n"));
    EXPECT_TRUE(client.write(classic("Transform { translation 1 2 3 }\n")).empty()) << "mended";
    client.report("textDocument/didClose", {{"textDocument", {{"uri", client.uri}}}});
    EXPECT_TRUE(client.faults().empty());
}

TEST(LanguageServer, MisspelledWordsAreMended) {
    Client client;
    const auto mended = [&](const std::string& text, const char* name) {
        const Json faults = client.write(text, name);
        return faults.empty() ? "no fault" : client.mended(faults[0]);
    };
    EXPECT_EQ(mended(xml("<Transform translaton='1 2 3'/>"), kXml), xml("<Transform translation='1 2 3'/>"));
    EXPECT_EQ(mended(xml("<Group>\n<Trasnform DEF='Trasnform1'/></Group>"), kXml),
              xml("<Group>\n<Transform DEF='Trasnform1'/></Group>"));
    EXPECT_EQ(mended(classic("DEF Spere Shape { geometry Spere { } }"), "file:///nowhere/a.x3dv"),
              classic("DEF Spere Shape { geometry Sphere { } }"))
        << "not the name that is spelled so, too";
    EXPECT_EQ(mended(classic("Shape { geometry Zzzzz { } }"), "file:///nowhere/a.x3dv"), "");
}

TEST(LanguageServer, PlacesCountUnitsOfUtf16OrBytes) {
    const std::string text =
        classic("# \xF0\x9F\x8C\x8D \xC3\xA9\nTransform { name \"\xF0\x9F\x8C\x8D\" scales 1 1 1 }");
    Client units;
    EXPECT_EQ(units.initialized.at("capabilities").at("positionEncoding"), "utf-16");
    const Json start = units.write(text)[0].at("range").at("start");
    EXPECT_EQ(start.at("line"), 3);
    Client bytes({}, true);
    EXPECT_EQ(bytes.initialized.at("capabilities").at("positionEncoding"), "utf-8");
    bytes.write(text);
    const Json faults = units.write(classic("\xF0\x9F\x8C\x8D\xC3\xA9 { } Grop { }"));
    ASSERT_GE(faults.size(), 2U) << faults;
    EXPECT_EQ(faults[1].at("range").at("start").at("character"), 8);
    const Json same = bytes.write(classic("\xF0\x9F\x8C\x8D\xC3\xA9 { } Grop { }"));
    EXPECT_EQ(same[1].at("range").at("start").at("character"), 11);
    // Beyond the end of a line is its end.
    const editor::TextLines lines("ab\r\nc\rd\n", false);
    EXPECT_EQ(lines.offsetOf(editor::TextPosition{0, 99}), 2U);
    EXPECT_EQ(lines.offsetOf(editor::TextPosition{1, 0}), 4U);
    EXPECT_EQ(lines.offsetOf(editor::TextPosition{2, 1}), 7U);
    EXPECT_EQ(lines.offsetOf(editor::TextPosition{77, 1}), 8U);
    EXPECT_EQ(lines.positionOf(7).line, 2U);
}

TEST(LanguageServer, NodesFieldsAndNamesAreCompleted) {
    Client client;
    // ClassicVRML
    EXPECT_THAT(client.proposals(classic("|")), IsSupersetOf({"Transform", "Shape", "ROUTE", "PROTO"}));
    EXPECT_THAT(client.proposals(classic("Tran|")), Contains("Transform"));
    EXPECT_THAT(client.proposals(classic("Shape { geo|")), IsSupersetOf({"geometry", "appearance"}));
    const auto geometries = client.proposals(classic("Shape { geometry |"));
    EXPECT_THAT(geometries, IsSupersetOf({"Box", "IndexedFaceSet", "DEF", "USE"}));
    EXPECT_THAT(geometries, Not(Contains("Transform")));
    EXPECT_THAT(client.proposals(classic("Group { children [ Shape { } |")), Contains("Transform"));
    EXPECT_THAT(client.proposals(classic("Group { children [ Shape { } ] |")), Contains("bboxSize"));
    const auto fields = client.proposals(classic("Transform { translation 1 2 3 |"));
    EXPECT_THAT(fields, Contains("scale"));
    EXPECT_THAT(fields, Not(Contains("translation"))) << "it is given";
    EXPECT_THAT(client.proposals(classic("TimeSensor { loop |")), testing::ElementsAre("TRUE", "FALSE"));
    EXPECT_THAT(client.proposals(classic("Fog { fogType \"|")), IsSupersetOf({"LINEAR", "EXPONENTIAL"}));
    EXPECT_THAT(client.proposals(classic("DEF A Group { } DEF B Shape { } Group { children USE |")),
                testing::ElementsAre("A", "B"));
    EXPECT_THAT(client.proposals(classic("DEF T TimeSensor { } DEF P PositionInterpolator { } ROUTE T.|")),
                IsSupersetOf({"fraction_changed", "isActive"}));
    EXPECT_THAT(client.proposals(classic("DEF T TimeSensor { } ROUTE T.time TO |\nDEF P Group { }")),
                testing::ElementsAre("T", "P"));
    EXPECT_THAT(client.proposals(classic("PROTO Chair [ ] { Group { } } |")), Contains("Chair"));
    EXPECT_THAT(client.proposals(classic("# Tran|")), testing::IsEmpty());
    EXPECT_THAT(client.proposals(classic("DEF |")), testing::IsEmpty());
    // XML
    EXPECT_THAT(client.proposals(xml("<|"), kXml), IsSupersetOf({"Transform", "ROUTE"}));
    const auto inShape = client.proposals(xml("<Shape><|"), kXml);
    EXPECT_THAT(inShape, IsSupersetOf({"Box", "Appearance"}));
    EXPECT_THAT(inShape, Not(Contains("Transform")));
    EXPECT_THAT(client.proposals(xml("<Transform |"), kXml), IsSupersetOf({"translation", "DEF", "USE"}));
    EXPECT_THAT(client.proposals(xml("<Transform scale='1 1 1' s|"), kXml), Not(Contains("scale")));
    EXPECT_THAT(client.proposals(xml("<TimeSensor loop='|"), kXml), testing::ElementsAre("true", "false"));
    EXPECT_THAT(client.proposals(xml("<Group DEF='A'/><Group USE='|"), kXml), testing::ElementsAre("A"));
    EXPECT_THAT(client.proposals(xml("<TimeSensor DEF='T'/><ROUTE fromNode='T' fromField='|"), kXml),
                Contains("fraction_changed"));
    EXPECT_THAT(client.proposals(xml("<ROUTE |"), kXml), Contains("toField"));
    EXPECT_THAT(client.proposals(xml("<!-- <|"), kXml), testing::IsEmpty());
    // Prototypes
    const std::string chair =
        "PROTO Chair [ inputOutput SFFloat height 1 inputOnly SFTime sit initializeOnly MFNode "
        "parts [ Group { } ] ] { Group { } } ";
    EXPECT_THAT(client.proposals(classic(chair + "Chair { |")), testing::ElementsAre("height", "parts"));
    EXPECT_THAT(client.proposals(classic(chair + "DEF C Chair { } ROUTE X.y TO C.|")),
                testing::ElementsAre("height", "sit"));
    EXPECT_THAT(client.proposals(xml("<ProtoDeclare name='Chair'><ProtoInterface><field name='height' type='SFFloat' "
                                     "accessType='inputOutput'/></ProtoInterface></ProtoDeclare><ProtoInstance "
                                     "name='Chair'><fieldValue name='|"),
                                 kXml),
                testing::ElementsAre("height"));
    // The existing part of the word is replaced.
    const Json item = client.at("textDocument/completion", classic("Group { } Tran|")).at("items").at(0);
    EXPECT_EQ(client.marked(item.at("textEdit").at("range")), "Tran");
}

TEST(LanguageServer, NodesAndFieldsAreExplainedWithTheirClause) {
    Client client;
    const auto said = [&](const std::string& marked, const char* name = "file:///nowhere/a.x3dv") {
        const Json answer = client.at("textDocument/hover", marked, name);
        return answer.is_null() ? std::string() : answer.at("contents").at("value").get<std::string>();
    };
    EXPECT_THAT(said(classic("Trans|form { }")),
                HasSubstr("Grouping component, level 1; ISO/IEC 19775-1 V4.0, clause 10"));
    EXPECT_THAT(said(classic("Transform { trans|lation 1 2 3 }")), HasSubstr("SFVec3f [in,out] translation 0 0 0"));
    EXPECT_THAT(said(classic("Transform { trans|lation 1 2 3 }")), HasSubstr("Unit: length"));
    EXPECT_THAT(said(classic("Transform { translation 1 |2 3 }")), "");
    EXPECT_THAT(said(classic("DEF A Shape { geometry Box { } } ROUTE A|.x TO A.y")), HasSubstr("**Shape**"));
    EXPECT_THAT(said(classic("DEF T TimeSensor { } ROUTE T.fraction|_changed TO T.y")),
                HasSubstr("SFFloat [out] fraction_changed"));
    EXPECT_THAT(said(xml("<Material shin|iness='.1'/>"), kXml), HasSubstr("[0, 1]"));
    EXPECT_THAT(said(xml("<Mat|erial/>"), kXml), HasSubstr("clause 12"));
    EXPECT_EQ(said(xml("<Nonsen|se/>"), kXml), "");
    EXPECT_THAT(said(classic("PROTO Chair [ inputOutput SFFloat height 1 ] { Group { } } Ch|air { }")),
                HasSubstr("inputOutput SFFloat height"));
    EXPECT_THAT(said(classic("PROTO Chair [ inputOutput SFFloat height 1 ] { Group { } } Chair { hei|ght 2 }")),
                HasSubstr("Of PROTO Chair"));
    // The clauses are those of the tables of node types.
    const std::regex heading("# (\\w+) component: ISO/IEC 19775-1 V4.0 clause (\\d+)");
    std::size_t count = 0;
    for (const auto& file : std::filesystem::directory_iterator(std::string(RTSG_SOURCE_DIR) + "/core/spec")) {
        std::ifstream in(file.path());
        std::string line;
        std::smatch match;
        if (!std::getline(in, line) || !std::regex_search(line, match, heading)) continue;
        EXPECT_EQ(editor::clauseOf(match[1].str()), std::stoi(match[2])) << line;
        ++count;
    }
    EXPECT_EQ(count, 36U);
}

TEST(LanguageServer, NamesLeadToTheirDefinitions) {
    Client client;
    const auto found = [&](const std::string& marked, const char* name = "file:///nowhere/a.x3dv") {
        const Json answer = client.at("textDocument/definition", marked, name);
        return answer.is_null() ? -1 : static_cast<int>(client.offset(answer.at("range").at("start")));
    };
    const std::size_t head = classic("").size(), start = xml("").find("</Scene>");
    EXPECT_EQ(found(classic("DEF A Group { }\nGroup { children USE |A }")), head + 4);
    EXPECT_EQ(found(classic("DEF A Group { } DEF A Shape { } ROUTE A|.x TO B.y")), head + 20) << "the last before it";
    EXPECT_EQ(found(classic("ROUTE B.y TO |A.x DEF A Group { }")), head + 21);
    EXPECT_EQ(found(classic("PROTO Chair [ ] { Group { } } Ch|air { }")), head + 6);
    EXPECT_EQ(found(classic("Group { children USE |A }")), -1);
    EXPECT_EQ(found(xml("<Group DEF='A'/><Group USE='|A'/>"), kXml), start + 12);
    EXPECT_EQ(found(xml("<Group DEF='A'/><ROUTE fromNode='|A' fromField='x'/>"), kXml), start + 12);
    EXPECT_EQ(found(xml("<ProtoDeclare name='P'><ProtoBody/></ProtoDeclare><ProtoInstance name='|P'/>"), kXml),
              start + 20);
}

TEST(LanguageServer, FaultsOfInlinedFilesAndOfJsonAreReported) {
    const test::TempFolder folder;
    std::ofstream(folder.path() / "b b.x3dv") << "#X3D V4.0 utf8\nPROFILE Immersive\nTransform { nothing 1 }";
    Client client;
    const std::string here = "file://" + (folder.path() / "a%20a.x3dv").string();
    const Json faults = client.write(classic("Inline { url \"b%20b.x3dv\" }"), here);
    ASSERT_EQ(faults.size(), 1U) << faults;
    EXPECT_THAT(faults[0].at("message").get<std::string>(), HasSubstr("b b.x3dv:3:13: Transform has no field"));
    EXPECT_EQ(client
                  .write(R"({"X3D":{"@version":"4.0","@profile":"Immersive","Scene":{"-children":[{"Grop":{}}]}}})",
                         "untitled:Untitled-1")
                  .size(),
              1U);
    EXPECT_TRUE(client.at("textDocument/completion", "{\"X3D|\"").at("items").empty());
}

TEST(LanguageServer, EditsOfPartsAreTakenInTheirOrder) {
    Client client;
    client.write(classic("Transform { translation 1 2 3 }\nShape { }\n"));
    const auto edit = [&](Json changes) {
        client.report("textDocument/didChange", {{"textDocument", {{"uri", client.uri}, {"version", 2}}},
                                                 {"contentChanges", std::move(changes)}});
        return client.faults();
    };
    const auto at = [](int line, int from, int to) {
        return Json{{"start", {{"line", line}, {"character", from}}}, {"end", {{"line", line}, {"character", to}}}};
    };
    EXPECT_EQ(edit({{{"range", at(2, 12, 13)}, {"text", "T"}}}).size(), 1U);
    EXPECT_TRUE(edit({{{"range", at(2, 12, 13)}, {"text", ""}}, {{"range", at(2, 12, 12)}, {"text", "t"}}}).empty());
    EXPECT_TRUE(
        edit({{{"range", at(3, 0, 9)}, {"text", "DEF \xF0\x9F\x8C\x8D Group { }\nTransform { children USE A }"}},
              {{"range", at(3, 4, 6)}, {"text", "A"}}})
            .empty())
        << "places count units of UTF-16";
    EXPECT_EQ(edit({{{"text", classic("Nonsense { }")}}}).size(), 1U) << "the whole text";
    EXPECT_EQ(edit({{{"range", at(77, 0, 3)}, {"text", "\nNonsense { }"}}}).size(), 2U) << "beyond the end is the end";
}

std::vector<std::string> outline(const Json& symbols, const std::string& before = "") {
    std::vector<std::string> lines;
    for (const Json& one : symbols) {
        lines.push_back(before + one.at("name").get<std::string>() + ": " + one.at("detail").get<std::string>());
        for (std::string& line : outline(one.at("children"), before + "  ")) lines.push_back(std::move(line));
    }
    return lines;
}

TEST(LanguageServer, NodesAndPrototypesAreListed) {
    Client client;
    const Json answer = client.at(
        "textDocument/documentSymbol",
        classic(
            "PROTO P [ ] { DEF T Transform { children Shape { } } }\nDEF A Group { children [ DEF B Shape { } ] }|"));
    EXPECT_THAT(outline(answer),
                testing::ElementsAre("P: PROTO", "  T: Transform", "    Shape: children", "A: Group", "  B: Shape"));
    EXPECT_EQ(client.marked(answer.at(1).at("range")), "A Group { children [ DEF B Shape { } ] }");
    EXPECT_EQ(client.marked(answer.at(1).at("selectionRange")), "A");
    const Json same =
        client.at("textDocument/documentSymbol",
                  xml("<ProtoDeclare name='P'><ProtoBody><Transform DEF='T'><Shape/></Transform></ProtoBody>"
                      "</ProtoDeclare><Group DEF='A'><Shape DEF='B'/></Group>|"),
                  kXml);
    EXPECT_THAT(outline(same),
                testing::ElementsAre("P: PROTO", "  T: Transform", "    Shape: ", "A: Group", "  B: Shape"));
    EXPECT_EQ(client.marked(same.at(1).at("range")), "A'><Shape DEF='B'/></Group>");
    // Of large documents the nodes with names.
    std::string many = "DEF A Group { children [ ";
    for (int i = 0; i < 3000; ++i) many += "Group { children DEF B" + std::to_string(i) + " Shape { } } ";
    EXPECT_EQ(client.at("textDocument/documentSymbol", classic(many + "] }|")).at(0).at("children").size(), 3000U);
}

TEST(LanguageServer, NamesChangeWithTheirUsesAndRoutes) {
    Client client;
    const auto renamed = [&](const std::string& marked, const char* name, const std::string& to) {
        const std::size_t mark = marked.find('|');
        std::string text = marked;
        text.erase(mark, 1);
        client.write(text, name);
        const auto position = editor::TextLines(text, false).positionOf(mark);
        const Json answer = client.ask("textDocument/rename",
                                       {{"textDocument", {{"uri", client.uri}}},
                                        {"position", {{"line", position.line}, {"character", position.character}}},
                                        {"newName", to}});
        if (answer.contains("error")) return answer.at("error").at("message").get<std::string>();
        const Json edits = answer.at("result").at("changes").at(client.uri);
        for (auto edit = edits.rbegin(); edit != edits.rend(); ++edit) {
            const std::size_t begin = client.offset(edit->at("range").at("start"));
            text.replace(begin, client.offset(edit->at("range").at("end")) - begin,
                         edit->at("newText").get<std::string>());
        }
        return text;
    };
    constexpr const char* kClassic = "file:///nowhere/a.x3dv";
    EXPECT_EQ(renamed(classic("PROTO P [ ] { DEF A Group { } }\nDEF A| TimeSensor { } DEF B Group { children USE A }\n"
                              "ROUTE A.time TO B.x\nEXPORT A AS A\nIMPORT A.C AS D"),
                      kClassic, "Clock"),
              classic("PROTO P [ ] { DEF A Group { } }\nDEF Clock TimeSensor { } DEF B Group { children USE Clock }\n"
                      "ROUTE Clock.time TO B.x\nEXPORT Clock AS A\nIMPORT Clock.C AS D"))
        << "but for that of the prototype's body";
    EXPECT_EQ(renamed(classic("PROTO P [ ] { DEF A| Group { } USE A }\nDEF A Group { }"), kClassic, "B"),
              classic("PROTO P [ ] { DEF B Group { } USE B }\nDEF A Group { }"));
    EXPECT_EQ(renamed(classic("PROTO Chair [ ] { Group { } }\nChair| { } DEF Chair Chair { }"), kClassic, "Seat"),
              classic("PROTO Seat [ ] { Group { } }\nSeat { } DEF Chair Seat { }"));
    EXPECT_EQ(renamed(xml("<Group DEF='A'/><Group USE='|A'/><ROUTE fromNode='A' fromField='A' toNode='B' toField='x'/>"
                          "<EXPORT localDEF='A' AS='A'/>"),
                      kXml, "G"),
              xml("<Group DEF='G'/><Group USE='G'/><ROUTE fromNode='G' fromField='A' toNode='B' toField='x'/>"
                  "<EXPORT localDEF='G' AS='A'/>"));
    EXPECT_THAT(renamed(classic("DEF A| Group { } DEF B Group { }"), kClassic, "B"), HasSubstr("B is there already"));
    EXPECT_THAT(renamed(classic("DEF A| Group { }"), kClassic, "a b"), HasSubstr("is no name in every encoding"));
    EXPECT_THAT(renamed(classic("DEF A| Group { }"), kClassic, "ROUTE"), HasSubstr("is no name in every encoding"));
    EXPECT_THAT(renamed(classic("Gro|up { }"), kClassic, "B"), HasSubstr("no name of a node"));
    EXPECT_EQ(client.marked(client.at("textDocument/prepareRename", classic("DEF Some|thing Group { }"))), "Something");
    EXPECT_TRUE(client.at("textDocument/prepareRename", classic("Gro|up { }")).is_null());
    const Json locations = client.at("textDocument/references", classic("DEF A Group { } ROUTE A|.x TO A.y USE A"));
    EXPECT_EQ(locations.size(), 4U);
}

TEST(LanguageServer, LinesAreIndentedByTheirBracketsOrElements) {
    Client client;
    const auto indented = [&](const std::string& text, const char* name, Json style) {
        client.write(text, name);
        const Json edits = client
                               .ask("textDocument/formatting",
                                    {{"textDocument", {{"uri", client.uri}}}, {"options", std::move(style)}})
                               .at("result");
        std::string result = text;
        for (auto edit = edits.rbegin(); edit != edits.rend(); ++edit) {
            const std::size_t begin = client.offset(edit->at("range").at("start"));
            result.replace(begin, client.offset(edit->at("range").at("end")) - begin,
                           edit->at("newText").get<std::string>());
        }
        return result;
    };
    const Json spaces = {{"tabSize", 2}, {"insertSpaces", true}}, tabs = {{"tabSize", 4}, {"insertSpaces", false}};
    const std::string wanted =
        "#X3D V4.0 utf8\nGroup {\n  children [\n    # not } here\n    Shape { }\n\n    Script { url \"a }\n b {\n\" "
        "}\n  ]\n}\n"
        "Group { }\n";
    const std::string crooked =
        "#X3D V4.0 utf8\nGroup {\nchildren [\n        # not } here\n\tShape { }\n  \nScript { url \"a }\n b {\n\" }\n  "
        "  ]\n}\n"
        " Group { }\n";
    EXPECT_EQ(indented(crooked, "file:///nowhere/a.x3dv", spaces), wanted);
    EXPECT_EQ(indented(wanted, "file:///nowhere/a.x3dv", spaces), wanted);
    EXPECT_EQ(indented("<?xml version='1.0'?>\n  <X3D>\n<Scene>\n<Group DEF='a>b'\nbboxSize='1 1 1'>\n<!-- <Group>\n x "
                       "-->\n<Shape/>\n"
                       "</Group>\n<Script><![CDATA[\n a < b\n]]></Script>\n</Scene></X3D>\n",
                       kXml, tabs),
              "<?xml version='1.0'?>\n<X3D>\n\t<Scene>\n\t\t<Group DEF='a>b'\n\t\t\tbboxSize='1 1 1'>\n\t\t\t<!-- "
              "<Group>\n x -->\n"
              "\t\t\t<Shape/>\n\t\t</Group>\n\t\t<Script><![CDATA[\n a < b\n]]></Script>\n\t</Scene></X3D>\n");
    EXPECT_EQ(indented("{ \"X3D\": {\n\"a\": [\n1,\n\"# ]\"\n]\n}}\n", "file:///nowhere/a.json", spaces),
              "{ \"X3D\": {\n    \"a\": [\n      1,\n      \"# ]\"\n    ]\n}}\n");
}

TEST(LanguageServer, ACheckEndsWhenAMessageWaits) {
    bool isAwaited = true;
    LanguageServerOptions options;
    options.isAwaited = [&] { return isAwaited; };
    std::vector<Json> sent;
    LanguageServer server(options, [&](std::string_view message) { sent.push_back(Json::parse(message)); });
    server.receive(R"({"id":1,"method":"initialize"})");
    std::string text = classic("");
    for (int i = 0; i < 1000; ++i) text += "Group { }\n";
    server.receive(Json{{"method", "textDocument/didOpen"},
                        {"params", {{"textDocument", {{"uri", "file:///a.x3dv"}, {"text", text + "Nonsense { }"}}}}}}
                       .dump());
    sent.clear();
    server.work();
    EXPECT_TRUE(server.hasWork());
    EXPECT_TRUE(sent.empty());
    isAwaited = false;
    server.work();
    EXPECT_FALSE(server.hasWork());
    ASSERT_EQ(sent.size(), 1U);
    EXPECT_EQ(sent[0].at("params").at("diagnostics").size(), 1U);
}

// ---- whatever comes ------------------------------------------------------------------------------------------------

TEST(LanguageServer, MessagesThatMakeNoSenseAreAnswered) {
    std::vector<Json> sent;
    LanguageServer server({}, [&](std::string_view message) { sent.push_back(Json::parse(message)); });
    const auto code = [&](const std::string& message) {
        sent.clear();
        server.receive(message);
        return sent.empty() ? 0 : sent.back().value("error", Json::object()).value("code", 1);
    };
    EXPECT_EQ(code(R"({"jsonrpc":"2.0","id":1,"method":"textDocument/hover"})"), -32002);
    EXPECT_EQ(code("nothing"), -32700);
    EXPECT_EQ(code(""), -32700);
    EXPECT_EQ(code("{\"id\":1,\"method\":\"\xFF\"}"), -32700);
    EXPECT_EQ(code(std::string(1000, '[')), -32700);
    EXPECT_EQ(code(std::string(100000, '[') + std::string(100000, ']')), -32700);
    EXPECT_EQ(code("[]"), -32600);
    EXPECT_EQ(code("7"), -32600);
    EXPECT_EQ(code(R"({"id":[[1]],"method":"initialize"})"), -32600);
    EXPECT_EQ(code(R"({"id":1,"method":7})"), -32600);
    EXPECT_EQ(code(R"({"id":1,"method":"initialize","params":[3]})"), 1);
    EXPECT_EQ(code(R"({"id":2,"method":"initialize"})"), -32600);
    EXPECT_EQ(code(R"({"id":"a","method":"textDocument/hover","params":{"textDocument":7,"position":{"line":-1}}})"),
              -32602);
    EXPECT_EQ(code(R"({"id":3,"method":"workspace/nothing"})"), -32601);
    EXPECT_EQ(code(R"({"method":"textDocument/didOpen","params":{"textDocument":{"uri":7}}})"), 1);
    EXPECT_EQ(code(R"({"method":"textDocument/didChange","params":{"contentChanges":[]}})"), 1);
    server.receive(
        R"({"method":"textDocument/didOpen","params":{"textDocument":{"uri":"x","text":"#X3D V4.0 utf8\n"}}})");
    for (const char* position :
         {"{}", "7", "{\"line\":1e300,\"character\":-3}", "{\"line\":99999999999999,\"character\":9}"})
        EXPECT_EQ(
            code(fmt::format(
                R"({{"id":4,"method":"textDocument/completion","params":{{"textDocument":{{"uri":"x"}},"position":{}}}}})",
                position)),
            1);
    EXPECT_EQ(code(R"x({"id":5,"method":"textDocument/codeAction","params":{"textDocument":{"uri":"x"},"context":)x"
                   R"x({"diagnostics":[7,{},{"message":"(did you mean ?)"},{"message":"' (did you mean a?)"}]}}})x"),
              1);
    EXPECT_EQ(sent.back().at("result"), Json::array());
    EXPECT_EQ(code(R"({"id":9,"result":null})"), 0);
    EXPECT_EQ(code(R"({"id":6,"method":"shutdown"})"), 1);
    EXPECT_EQ(code(R"({"id":7,"method":"textDocument/hover"})"), -32600);
    server.receive(R"({"method":"exit"})");
    EXPECT_TRUE(server.hasEnded() && server.wasAsked());
}

TEST(LanguageServer, DocumentsAreLimited) {
    LanguageServerOptions options;
    options.maximumDocuments = 2;
    options.maximumBytes = 1000;
    Client client(options);
    client.write(classic(""), "file:///1.x3dv");
    client.write(classic(""), "file:///2.x3dv");
    EXPECT_TRUE(client.write(classic(""), "file:///3.x3dv").is_null());
    EXPECT_THAT(client.sent.back().dump(), HasSubstr("2 documents are open already"));
    client.server.receive(std::string(2000, ' '));
    EXPECT_THAT(client.sent.back().dump(), HasSubstr("too long"));
}

/// Any beginning of a text, and any text that has been cut up, is only text: each question has an answer.
TEST(LanguageServer, AnyTextMayBeAskedAbout) {
    const std::string texts[] = {
        classic(
            "PROTO P [ inputOutput SFVec3f at 0 0 0 ] { DEF T Transform { translation IS at children [ USE T ] } }\n"
            "DEF A P { at 1 2 3 } Shape { appearance Appearance { } } ROUTE A.at TO T.scale\n"),
        xml("<ProtoDeclare name='P'><ProtoInterface><field name='a' type='SFBool'/></ProtoInterface><ProtoBody><Group "
            "DEF='G'/></ProtoBody></ProtoDeclare><!-- x --><ProtoInstance name='P' DEF='I'/><ROUTE fromNode='I' "
            "fromField=\"a\" toNode='G'/>")};
    std::mt19937 random(5);
    for (const std::string& whole : texts)
        for (std::size_t round = 0; round < 2000; ++round) {
            std::string text = whole.substr(0, random() % (whole.size() + 1));
            for (std::size_t i = random() % 4; i-- > 0 && !text.empty();)
                text[random() % text.size()] = "{}[]<>'\"#./ \nA"[random() % 14];
            const std::size_t offset = random() % (text.size() + 1);
            const auto replaced = editor::proposalsAt(text, offset).replaced;
            ASSERT_LE(replaced.begin, replaced.end);
            ASSERT_LE(replaced.end, text.size());
            (void)editor::explanationAt(text, offset);
            (void)editor::definitionAt(text, offset);
            for (const editor::Symbol& one : editor::outlineOf(text)) {
                ASSERT_LE(one.all.begin, one.word.begin);
                ASSERT_LE(one.word.end, one.all.end);
                ASSERT_LE(one.all.end, text.size());
            }
            if (const auto ranges = editor::renamed(text, offset, "Other")) {
                for (const editor::TextRange& one : *ranges) {
                    ASSERT_LE(one.end, text.size());
                }
            }
            std::string bare, same;
            std::size_t at = 0;
            for (const editor::Indentation& one : editor::indentationOf(text, "  ")) {
                ASSERT_LE(at, one.replaced.begin);
                same += text.substr(at, one.replaced.begin - at) + one.with;
                at = one.replaced.end;
            }
            same += text.substr(at);
            const auto isSpace = [](char c) { return c == ' ' || c == '\t'; };
            std::ranges::remove_copy_if(text, std::back_inserter(bare), isSpace);
            std::erase_if(same, isSpace);
            ASSERT_EQ(same, bare) << "only white space changes";
        }
    // Deep nesting is skipped, and takes no longer.
    const std::string deep(1 << 20, '[');
    (void)editor::proposalsAt("#X3D V4.0 utf8\nGroup { children " + deep, deep.size());
    std::string elements = "<X3D>";
    for (int i = 0; i < 100000; ++i) elements += "<Group>";
    (void)editor::proposalsAt(elements + "<", elements.size() + 1);
}

class EditorStream : public testing::Test {
  protected:
    static std::string framed(const Json& message) {
        const std::string text = message.dump();
        return fmt::format("Content-Length: {}\r\n\r\n{}", text.size(), text);
    }
    Result<> serve(const std::string& input, LanguageServerOptions options = {}) {
        std::ofstream(folder.path() / "in", std::ios::binary) << input;
        const int in = ::open((folder.path() / "in").c_str(), O_RDONLY | O_CLOEXEC);
        const int out = ::open((folder.path() / "out").c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
        auto result = serveEditor(in, out, options);
        ::close(in);
        ::close(out);
        std::ifstream written(folder.path() / "out", std::ios::binary);
        output = {std::istreambuf_iterator<char>(written), {}};
        return result;
    }
    std::string problem(const std::string& input) {
        const auto served = serve(input);
        return served ? "none" : served.error().text;
    }
    const test::TempFolder folder;
    std::string output;
    const std::string begin = framed({{"id", 1}, {"method", "initialize"}}),
                      end = framed({{"id", 2}, {"method", "shutdown"}}) + framed({{"method", "exit"}});
};

TEST_F(EditorStream, ASessionIsServed) {
    const std::string open =
        framed({{"method", "textDocument/didOpen"},
                {"params", {{"textDocument", {{"uri", "file:///a.x3dv"}, {"text", "#X3D V4.0 utf8\nGrop { }"}}}}}});
    EXPECT_EQ(problem(begin + open + end), "none");
    EXPECT_THAT(output, testing::StartsWith("Content-Length: "));
    EXPECT_THAT(output, HasSubstr("hoverProvider"));
    EXPECT_THAT(output, Not(HasSubstr("publishDiagnostics"))) << "what waits comes first";
    EXPECT_EQ(problem("content-type: x\r\nCONTENT-LENGTH:  2\r\n\r\n{}" + begin + end), "none");
    EXPECT_THAT(output, HasSubstr("-32600"));
    EXPECT_EQ(problem("Content-Length: 3\r\n\r\n{{{" + begin + end), "none");
    EXPECT_THAT(output, HasSubstr("-32700"));
}

TEST_F(EditorStream, OneThatIsFramedWronglyEndsWithAReason) {
    EXPECT_THAT(problem(begin), HasSubstr("gone without an exit"));
    EXPECT_THAT(problem(begin + framed({{"method", "exit"}})), HasSubstr("exit before shutdown"));
    EXPECT_THAT(problem("Content-Length: 99\r\n\r\n{}"), HasSubstr("end within one"));
    EXPECT_THAT(problem("Content-Length: 99"), HasSubstr("end within a header"));
    EXPECT_THAT(problem("Content-Length: -1\r\n\r\n{}"), HasSubstr("no length of a message"));
    EXPECT_THAT(problem("Content-Length: 2x\r\n\r\n{}"), HasSubstr("no length of a message"));
    EXPECT_THAT(problem("Content-Length: 99999999999999999999999\r\n\r\n{}"), HasSubstr("no length of a message"));
    EXPECT_THAT(problem("Content-Length: 2\r\nContent-Length: 3\r\n\r\n{}"), HasSubstr("no length of a message"));
    EXPECT_THAT(problem("Content-Length: 99999999999\r\n\r\n{}"), HasSubstr("at most 33554432 are taken"));
    EXPECT_THAT(problem("Other: 2\r\n\r\n{}"), HasSubstr("no Content-Length"));
    EXPECT_THAT(problem(std::string(1 << 20, 'x')), HasSubstr("begins with no header"));
}

}  // namespace
}  // namespace rtsg
