// A scene follows its document: what was edited and no more, so that the scene is as if the edited file had been
// loaded.
#include <algorithm>
#include <fstream>
#include <random>
#include <regex>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/edited_document.h>
#include <rtsg/documents/scene_exporter.h>
#include <rtsg/documents/writer.h>

#include "core/scene_check.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

using testing::HasSubstr;

std::string savedText(const Scene& scene) {
    std::string text;
    Diagnostics problems("export");
    const auto writer = makeWriter(Encoding::classicVrml, [&](std::string_view piece) { text += piece; }, problems);
    SceneExporter(scene, problems).write(*writer, Encoding::classicVrml);
    EXPECT_EQ(test::allText(problems), "");
    return text;
}

/// A scene that follows texts.
class Followed {
  public:
    explicit Followed(const std::string& text) {
        read(scene, text);
        document.emplace(scene);
        replica_.apply(std::make_shared<ChangeSet>(scene.snapshot())).value();
    }
    /// Returns the set; none where nothing was edited.
    std::shared_ptr<const ChangeSet> follow(const std::string& text) {
        auto edited = document->emptyScene();
        read(*edited, text);
        Diagnostics diagnostics("edit");
        const auto done = document->follow(std::move(edited), diagnostics);
        EXPECT_TRUE(done) << done.error().text;
        problems = test::allText(diagnostics);
        return seal();
    }
    std::shared_ptr<const ChangeSet> seal() {
        auto set = scene.seal();
        if (!set) return set;
        const auto applied = replica_.apply(set);
        EXPECT_TRUE(applied) << applied.error().text;
        EXPECT_EQ(replica_.hash(), scene.hash());
        return set;
    }
    /// The same, with nothing told, and what is there now is what the text makes.
    std::size_t followWhole(const std::string& text) {
        const auto set = follow(text);
        EXPECT_EQ(problems, "");
        Scene anew;
        read(anew, text);
        // The second prototype of a name is called so in the scene, and not in the document.
        static const std::regex counted("([A-Z][A-Za-z]*)#[0-9]+ ");
        EXPECT_EQ(std::regex_replace(test::canonicalText(scene), counted, "$1 "),
                  std::regex_replace(test::canonicalText(anew), counted, "$1 "));
        EXPECT_EQ(savedText(scene), savedText(anew));
        return set ? set->changes.size() : 0;
    }
    static void read(Scene& into, const std::string& text) {
        Diagnostics diagnostics("test.x3dv");
        EXPECT_TRUE(loadText(into, text.starts_with("#") ? text : "#X3D V4.0 utf8\n" + text, diagnostics));
        EXPECT_EQ(diagnostics.errors(), 0U) << test::allText(diagnostics);
    }
    std::string get(const std::string& name, std::string_view field) const {
        const Node& node = scene.node(scene.findName(name));
        return printFieldText(node.value(node.type().find(field)));
    }

    Scene scene;
    std::optional<EditedDocument> document;
    std::string problems;

  private:
    Scene replica_;
};

TEST(EditedDocument, AnEditedValueIsOneChange) {
    const auto text = [](const char* color, const char* size) {
        return fmt::format(
            "Transform {{ children [ Shape {{ appearance Appearance {{ material Material {{ diffuseColor "
            "{} }} }} geometry Box {{ size {} }} }} Shape {{ geometry Sphere {{ }} }} ] }}",
            color, size);
    };
    Followed followed(text("1 0 0", "1 1 1"));
    EXPECT_EQ(followed.followWhole(text("1 0 0", "1 1 1")), 0U);
    EXPECT_EQ(followed.followWhole(text("0 1 0", "1 1 1")), 1U);
    EXPECT_EQ(followed.followWhole(text("0 0 1", "1 2 3")), 2U);
    Scene anew;
    Followed::read(anew, text("0 0 1", "1 2 3"));
    EXPECT_EQ(followed.scene.hash(), anew.hash()) << "the nodes have their numbers still";
    EXPECT_EQ(followed.followWhole(text("1 0 0", "1 1 1")), 2U) << "an edit that is taken back";
}

TEST(EditedDocument, NodesAreFoundByTheirNamesWhereverTheyStandNow) {
    Followed followed(
        "DEF A Transform { children [ DEF B Transform { translation 1 0 0 } Group { } ] } DEF C Group { }");
    const NodeId b = followed.scene.findName("B");
    EXPECT_LE(followed.followWhole("DEF A Transform { children Group { } } DEF C Group { children DEF B Transform { "
                                   "translation 2 0 0 } }"),
              3U);
    EXPECT_EQ(followed.scene.findName("B"), b);
    // The upper node is below now.
    followed.followWhole(
        "DEF C Group { children DEF B Transform { children DEF A Transform { children Group { } } } }");
    EXPECT_EQ(followed.scene.findName("B"), b);
    followed.followWhole("DEF C Group { children DEF A Transform { children DEF B Transform { } } }");
    EXPECT_EQ(followed.scene.findName("B"), b);
    EXPECT_EQ(followed.followWhole("DEF C Group { children DEF New Transform { children DEF B Transform { } } }"), 1U);
}

TEST(EditedDocument, NamelessNodesAreFoundByTheirPlaces) {
    const auto shapes = [](std::initializer_list<int> sizes) {
        std::string text = "Group { children [ ";
        for (const int one : sizes) text += fmt::format("Shape {{ geometry Sphere {{ radius {} }} }} ", one);
        return text + "] }";
    };
    Followed followed(shapes({1, 2, 3, 4, 5, 6}));
    EXPECT_EQ(followed.followWhole(shapes({1, 2, 9, 3, 4, 5, 6})), 5U) << "two nodes, a radius, and where they go";
    EXPECT_EQ(followed.followWhole(shapes({2, 9, 3, 4, 5, 6})), 3U) << "taken out of the list, and two destroyed";
    EXPECT_EQ(followed.followWhole(shapes({2, 9, 7, 4, 5, 6})), 1U);
    EXPECT_LE(followed.followWhole(shapes({9, 4, 5, 6, 2, 7})), 6U);
    EXPECT_EQ(followed.followWhole(shapes({})), 13U);
    // The same node twice in a list, and one of them taken out.
    Followed twice("Group { children [ DEF X Group { } DEF Y Group { } USE X ] }");
    EXPECT_EQ(twice.followWhole("Group { children [ DEF X Group { } DEF Y Group { } ] }"), 1U);
    twice.followWhole("Group { children [ DEF Y Group { } DEF X Group { } USE Y USE X ] }");
    twice.followWhole("Group { children [ DEF X Group { } DEF Y Group { } USE X USE Y ] }");
    // One wrapped in another stays the same node.
    Followed wrapped("Group { children Shape { geometry Cone { height 7 } } }");
    wrapped.followWhole("Group { children Transform { children Shape { geometry Cone { height 7 } } } }");
    EXPECT_EQ(wrapped.scene.nodeCount(), 5U);
}

TEST(EditedDocument, WhatTheSceneHasDoneMeanwhileStays) {
    Followed followed("DEF T Transform { translation 1 0 0 children DEF G Group { } } DEF M Material { }");
    Scene& scene = followed.scene;
    ASSERT_TRUE(scene.set(scene.findName("T"), x3d::Transform::translation, Vec3f(5, 5, 5)));
    const NodeId own = scene.createNode(x3d::Group::type);
    ASSERT_TRUE(scene.insertChild(scene.findName("T"), x3d::Transform::children, own, 0));
    followed.seal();
    EXPECT_EQ(followed
                  .follow("DEF T Transform { translation 1 0 0 scale 2 2 2 children [ DEF G Group { } DEF H Group { } "
                          "] } DEF M Material { }")
                  ->changes.size(),
              4U);
    EXPECT_EQ(followed.get("T", "translation"), "5 5 5") << "the document says the same as before of it";
    EXPECT_EQ(followed.get("T", "scale"), "2 2 2");
    const auto& children = scene.node(scene.findName("T")).get(x3d::Transform::children);
    EXPECT_THAT(std::vector<NodeId>(children.begin(), children.end()),
                testing::ElementsAre(own, scene.findName("G"), scene.findName("H")));
    // An edit of what is gone is left out; the rest is done.
    ASSERT_TRUE(scene.destroyNode(scene.findName("G")));
    followed.follow(
        "DEF T Transform { translation 0 0 9 scale 2 2 2 children [ DEF G Group { children Group { } } DEF H "
        "Group { } ] } DEF M Material { }");
    EXPECT_EQ(followed.get("T", "translation"), "0 0 9") << "the document's edit counts";
    EXPECT_EQ(followed.problems, "");
    EXPECT_FALSE(scene.findName("G"));
}

TEST(EditedDocument, RoutesScriptsAndHeadsFollow) {
    Followed followed(
        "META \"a\" \"b\" DEF T TimeSensor { } DEF P PositionInterpolator { } DEF X Transform { } ROUTE "
        "T.fraction_changed TO P.set_fraction");
    EXPECT_EQ(
        followed.followWhole("META \"a\" \"b\" DEF T TimeSensor { } DEF P PositionInterpolator { } DEF X Transform "
                             "{ } ROUTE T.fraction_changed TO P.set_fraction ROUTE P.value_changed TO "
                             "X.translation"),
        1U);
    EXPECT_EQ(
        followed.followWhole("META \"a\" \"c\" DEF T TimeSensor { } DEF P PositionInterpolator { } DEF X Transform "
                             "{ } ROUTE P.value_changed TO X.translation"),
        2U);
    followed.followWhole("DEF S Script { inputOnly SFTime at initializeOnly SFNode me USE S url \"ecmascript:\" }");
    EXPECT_EQ(followed.followWhole("DEF S Script { inputOnly SFTime at initializeOnly SFNode me USE S url "
                                   "\"ecmascript: function at() {}\" }"),
              1U);
    const NodeId before = followed.scene.findName("S");
    followed.followWhole("DEF S Script { inputOnly SFTime when initializeOnly SFNode me USE S }");
    EXPECT_NE(followed.scene.findName("S"), before) << "one with other fields is another node";
}

TEST(EditedDocument, PrototypesFollow) {
    const auto text = [](const char* body, const char* use) {
        return fmt::format(
            "PROTO P [ inputOutput SFVec3f at 0 0 0 inputOutput MFNode kids [ ] inputOnly SFColor paint "
            "outputOnly SFVec3f moved ] {{ DEF In Transform {{ translation IS at translation_changed IS "
            "moved children [ Group {{ children IS kids }} {} ] }} DEF M Material {{ diffuseColor IS "
            "paint }} }} PROTO Q [ ] {{ P {{ at 9 9 9 }} }} {}",
            body, use);
    };
    Followed followed(text("Group { }", "DEF A P { at 1 2 3 } Q { }"));
    EXPECT_EQ(followed.followWhole(text("Group { }", "DEF A P { at 1 2 4 } Q { }")), 2U)
        << "the instance's and its body's";
    const NodeId a = followed.scene.findName("A");
    followed.followWhole(text("Group { }", "DEF A P { at 1 2 4 kids [ DEF K Group { } Shape { } ] } Q { }"));
    followed.followWhole(
        text("Group { }", "DEF A P { at 1 2 4 kids [ Shape { } DEF K Group { } Switch { } ] } Q { } P { }"));
    EXPECT_EQ(followed.scene.findName("A"), a);
    // One with another body is another prototype, whose instances are new.
    followed.followWhole(text("Switch { }", "DEF A P { at 1 2 4 } Q { }"));
    EXPECT_NE(followed.scene.findName("A"), a);
    EXPECT_THAT(savedText(followed.scene), HasSubstr("Switch"));
    followed.followWhole(text("Group { }", "DEF A P { at 1 2 4 } Q { }"));
    EXPECT_THAT(savedText(followed.scene), testing::Not(HasSubstr("Switch"))) << "taken back";
    // Instances that scripts make are of the prototype as it is now.
    followed.followWhole(text("LOD { }", "DEF A P { at 1 2 4 } Q { }"));
    const auto created = followed.scene.createNode("Q");
    ASSERT_TRUE(created) << created.error().text;
    EXPECT_EQ(followed.scene.effectiveNode(*created)->type().name, "Transform");
    EXPECT_EQ(followed.scene.nodeCount(), [&] {
        Scene anew;
        Followed::read(anew, text("LOD { }", "DEF A P { at 1 2 4 } Q { } Q { }"));
        return anew.nodeCount();
    }());
}

TEST(EditedDocument, APrototypeWithoutInstancesIsTakenBack) {
    const auto text = [](int radius) {
        return fmt::format("PROTO P [ ] {{ Shape {{ geometry Cylinder {{ radius {} }} }} }} Group {{ }}", radius);
    };
    Followed followed(text(1));
    for (const int radius : {2, 1, 2, 3, 1}) {
        followed.followWhole(text(radius));
        EXPECT_THAT(savedText(followed.scene), HasSubstr(fmt::format("radius {}", radius)));
    }
}

// ---- files ---------------------------------------------------------------------------------------------------------

class EditedFile : public testing::Test {
  protected:
    void write(const std::string& name, std::string_view text) {
        std::ofstream(folder / name, std::ios::binary) << text;
    }
    void load(const std::string& name) {
        ASSERT_TRUE(loadFile(scene, folder / name, diagnostics)) << test::allText(diagnostics);
        ASSERT_EQ(diagnostics.errors(), 0U) << test::allText(diagnostics);
        document.emplace(scene);
    }
    bool follow(const std::string& name) {
        diagnostics = Diagnostics((folder / name).string());
        const bool done = document->followFile(folder / name, diagnostics);
        set = scene.seal();
        if (!done) return false;
        Scene anew;
        EXPECT_TRUE(loadFile(anew, folder / name, diagnostics));
        EXPECT_EQ(test::canonicalText(scene), test::canonicalText(anew));
        return true;
    }
    std::size_t changes() const { return set ? set->changes.size() : 0; }

    const test::TempFolder own;
    const std::filesystem::path folder = own.path();
    Scene scene;
    Diagnostics diagnostics;
    std::optional<EditedDocument> document;
    std::shared_ptr<const ChangeSet> set;
};

TEST_F(EditedFile, OneThatIsWrongLeavesTheSceneAndSaysWhere) {
    write("a.x3d", "<X3D version='4.0' profile='Immersive'><Scene><Transform DEF='T'/></Scene></X3D>");
    load("a.x3d");
    const std::string before = scene.dump();
    for (const char* wrong :
         {"<X3D version='4.0' profile='Immersive'><Scene>\n<Transform DEF='T' sca",
          "<X3D version='4.0' profile='Immersive'><Scene>\n<Transform DEF='T' scale='1 2'/></Scene></X3D>",
          "<X3D version='4.0' profile='Immersive'><Scene>\n<ROUTE fromNode='T' fromField='a' "
          "toNode='U' toField='b'/></Scene></X3D>"}) {
        write("a.x3d", wrong);
        EXPECT_FALSE(follow("a.x3d")) << wrong;
        EXPECT_THAT(test::allText(diagnostics), HasSubstr("a.x3d:2:")) << wrong;
        EXPECT_EQ(scene.dump(), before);
        EXPECT_EQ(changes(), 0U);
    }
    write("a.x3d", "");
    EXPECT_FALSE(follow("a.x3d"));
    std::filesystem::remove(folder / "a.x3d");
    EXPECT_FALSE(follow("a.x3d"));
    write("a.x3d", "<X3D version='4.0' profile='Immersive'><Scene><Transform DEF='T' scale='1 2 3'/></Scene></X3D>");
    EXPECT_TRUE(follow("a.x3d"));
    EXPECT_EQ(changes(), 1U);
}

TEST_F(EditedFile, WhatItInlinesFollows) {
    write("a.x3dv",
          "#X3D V4.0 utf8\nDEF I Inline { url \"b.x3dv\" } IMPORT I.E AS E DEF G Group { } EXTERNPROTO P [ "
          "inputOutput SFFloat r ] \"p.x3dv\" P { }");
    write("b.x3dv", "#X3D V4.0 utf8\nDEF E Transform { children DEF F Transform { } } EXPORT E AS E");
    write("p.x3dv",
          "#X3D V4.0 utf8\nPROTO P [ inputOutput SFFloat r 1 ] { Group { children PointLight { radius IS r } } }");
    load("a.x3dv");
    const auto within = document->filesWithin(Resources(folder));
    EXPECT_THAT(within, testing::ElementsAre(std::filesystem::canonical(folder / "b.x3dv"),
                                             std::filesystem::canonical(folder / "p.x3dv")));
    write("b.x3dv", "#X3D V4.0 utf8\nDEF E Transform { children DEF F Transform { scale 1 2 3 } } EXPORT E AS E");
    EXPECT_TRUE(follow("a.x3dv")) << test::allText(diagnostics);
    EXPECT_EQ(changes(), 1U);
    write("p.x3dv",
          "#X3D V4.0 utf8\nPROTO P [ inputOutput SFFloat r 1 ] { Group { children SpotLight { radius IS r } } }");
    EXPECT_TRUE(follow("a.x3dv")) << test::allText(diagnostics);
    // Another file in the same place: all of it is new, and the loader of Inlines has nothing to do.
    write("c.x3dv", "#X3D V4.0 utf8\nDEF E Transform { } DEF Z Group { } EXPORT E AS E");
    write("a.x3dv",
          "#X3D V4.0 utf8\nDEF I Inline { url \"c.x3dv\" } IMPORT I.E AS E DEF G Group { } EXTERNPROTO P [ "
          "inputOutput SFFloat r ] \"p.x3dv\" P { }");
    EXPECT_TRUE(follow("a.x3dv")) << test::allText(diagnostics);
    // One that is wrong within counts.
    write("c.x3dv", "#X3D V4.0 utf8\n\nDEF E Transform { scale 1 }");
    EXPECT_FALSE(follow("a.x3dv"));
    EXPECT_THAT(test::allText(diagnostics), HasSubstr("c.x3dv:3:"));
}

// ---- any documents, any edits
// ----------------------------------------------------------------------------------------

/// Writes documents: groups, shapes, shared nodes, instances of prototypes, Scripts, routes.
class Author {
  public:
    explicit Author(std::uint32_t seed) : engine_(seed) {}
    std::size_t below(std::size_t count) { return std::uniform_int_distribution<std::size_t>(0, count - 1)(engine_); }
    bool chance(double probability) { return std::bernoulli_distribution(probability)(engine_); }
    float number() { return std::uniform_real_distribution<float>(.1f, 10)(engine_); }

    std::string document() {
        std::string text =
            "PROTO P [ inputOutput SFVec3f at 0 0 0 inputOutput MFNode kids [ ] ] { Transform { translation IS at "
            "children [ Group { children IS kids } Shape { geometry Sphere { } } ] } }\n"
            "PROTO Q [ inputOutput SFVec3f at 0 0 0 ] { DEF Outer Group { children P { at IS at } } }\n";
        for (std::size_t i = 0; i < 2 + below(4); ++i) text += node(0);
        for (std::size_t i = 0; i < below(4) && named_.size() > 1; ++i) text += route();
        return text;
    }

  private:
    std::string vec() { return fmt::format("{} {} {}", number(), number(), number()); }
    std::string route() {
        return fmt::format("ROUTE {}.translation TO {}.scale\n", named_[below(named_.size())],
                           named_[below(named_.size())]);
    }
    std::string children(int depth) {
        std::string text;
        for (std::size_t i = 0; depth < 4 && i < below(5); ++i) text += node(depth + 1);
        return text;
    }
    std::string shape() {
        return fmt::format(
            "Shape {{ appearance Appearance {{ material Material {{ diffuseColor {} }} }} geometry {} }}\n",
            chance(.5) ? "1 0 0" : fmt::format("0 {} 1", number() / 10),
            chance(.5) ? "Box { }" : fmt::format("Sphere {{ radius {} }}", number()));
    }
    std::string node(int depth) {
        switch (below(7)) {
            case 0:
                return fmt::format("P {{ at {} kids [ {} ] }}\n", vec(), children(depth));
            case 1:
                return fmt::format("Q {{ at {} }}\n", vec());
            case 2:
                if (!shared_.empty()) return "USE " + shared_[below(shared_.size())] + "\n";
                [[fallthrough]];
            case 3: {
                if (!chance(.3)) return shape();
                shared_.push_back(fmt::format("S{}", ++count_));
                return "DEF " + shared_.back() + " " + shape();
            }
            default: {
                const std::string inside = children(depth);
                std::string name;
                if (chance(.4)) {
                    named_.push_back(fmt::format("T{}", ++count_));
                    name = "DEF " + named_.back() + " ";
                }
                return fmt::format("{}Transform {{ translation {} children [ {} ] }}\n", name, vec(), inside);
            }
        }
    }

    std::mt19937 engine_;
    std::vector<std::string> named_, shared_;
    int count_ = 0;
};

/// Edits a scene as somebody edits its document.
class Editor {
  public:
    Editor(Scene& scene, Author& author) : scene_(scene), author_(author) {}

    void edit() {
        for (int tries = 0; tries < 100; ++tries)
            if (tryEdit()) return;
    }

  private:
    using T = x3d::Transform;
    NodeId any(const std::function<bool(const Node&)>& fits) {
        std::vector<NodeId> all;
        scene_.forEachNode([&](const Node& node) {
            if (!node.scope() && fits(node)) all.push_back(node.id());
        });
        return all.empty() ? NodeId{} : all[author_.below(all.size())];
    }
    NodeId anyTransform() {
        return any([](const Node& node) { return node.is(T::type); });
    }
    std::size_t childCount(NodeId id) { return scene_.node(id).get(T::children).size(); }
    /// Removes a node from the document.
    void drop(NodeId id) {
        if (!scene_.parents(id).empty()) return;
        std::vector<NodeId> below;
        const Node& node = scene_.node(id);
        for (const FieldIndex field : node.type().nodeFields()) {
            if (!node.type().fields[field].readable()) continue;
            if (node.type().fields[field].type == FieldType::SFNode)
                below.push_back(node.get(Field<NodeId>{field}));
            else
                for (const NodeId child : node.get(Field<Array<NodeId>>{field})) below.push_back(child);
        }
        ASSERT_TRUE(scene_.destroyNode(id));
        for (const NodeId child : below)
            if (child && scene_.find(child)) drop(child);
    }
    bool isBelow(NodeId id, NodeId above) {
        for (const ParentRef& parent : scene_.parents(id))
            if (parent.node == above || isBelow(parent.node, above)) return true;
        return id == above;
    }

    bool tryEdit() {
        const NodeId transform = anyTransform();
        switch (author_.below(8)) {
            case 0:
                if (!transform) return false;
                return scene_.set(transform, T::translation, Vec3f(author_.number())).has_value();
            case 1: {
                const NodeId material = any([](const Node& node) { return node.is(x3d::Material::type); });
                if (!material) return false;
                return scene_.set(material, x3d::Material::diffuseColor, Color{0, author_.number() / 10, 0})
                    .has_value();
            }
            case 2: {
                const NodeId instance = any([](const Node& node) { return node.type().kind == NodeType::Kind::proto; });
                if (!instance) return false;
                return scene_
                    .setField(instance, scene_.node(instance).type().find("at"), Value(Vec3f(author_.number())))
                    .has_value();
            }
            case 3: {
                if (!transform) return false;
                const NodeId fresh = scene_.createNode(T::type), shape = scene_.createNode(x3d::Shape::type);
                return scene_.set(fresh, T::translation, Vec3f(author_.number())).has_value() &&
                       scene_.insertChild(fresh, T::children, shape).has_value() &&
                       scene_.insertChild(transform, T::children, fresh, author_.below(childCount(transform) + 1))
                           .has_value();
            }
            case 4: {
                if (!transform || childCount(transform) == 0) return false;
                const std::size_t at = author_.below(childCount(transform));
                const NodeId child = scene_.node(transform).get(T::children)[at];
                if (!scene_.removeChild(transform, T::children.index, at)) return false;
                drop(child);
                return true;
            }
            case 5: {
                const NodeId named = any([&](const Node& node) { return !scene_.name(node.id()).empty(); });
                if (!named) return false;
                return scene_.setName(named, fmt::format("N{}", author_.below(1000000))).has_value();
            }
            case 6: {  // a named one goes elsewhere
                const NodeId named = any([&](const Node& node) {
                    return !scene_.name(node.id()).empty() && node.is(T::type) && scene_.parents(node.id()).size() == 1;
                });
                if (!named || !transform || isBelow(transform, named)) return false;
                const ParentRef from = scene_.parents(named)[0];
                if (scene_.node(from.node).type().kind == NodeType::Kind::proto) return false;
                const auto children = scene_.node(from.node).value(from.field).as<Array<NodeId>>();
                const auto at = std::ranges::find(children, named) - children.begin();
                return scene_.removeChild(from.node, from.field, static_cast<std::size_t>(at)).has_value() &&
                       scene_.insertChild(transform, T::children, named).has_value();
            }
            default: {
                const NodeId a = any([&](const Node& n) { return n.is(T::type) && !scene_.name(n.id()).empty(); });
                const NodeId b = any([&](const Node& n) { return n.is(T::type) && !scene_.name(n.id()).empty(); });
                if (!a) return false;
                const std::vector<Route> routes = scene_.routesFrom(a);
                if (!routes.empty() && author_.chance(.5))
                    return scene_.removeRoute(a, routes[0].fromField, routes[0].toNode, routes[0].toField).has_value();
                return scene_.addRoute(a, T::translation.index, b, T::center.index).has_value();
            }
        }
    }

    Scene& scene_;
    Author& author_;
};

class AnyEdit : public testing::TestWithParam<int> {};

/// The result is the scene of the edited file. Subscribers get no more changes for one edit than if it had been made to
/// the scene itself; for many edits of the same nameless nodes a few more.
TEST_P(AnyEdit, LeadsToTheEditedFileByNoMoreThanTheEdit) {
    const int edits = GetParam();
    std::size_t followed = 0, created = 0;
    for (std::uint32_t seed = 1; seed <= 150; ++seed) {
        SCOPED_TRACE(testing::Message() << "seed " << seed << ", edits " << edits);
        Author author(seed);
        Scene direct;
        Followed::read(direct, author.document());
        const std::string before = savedText(direct);
        direct.seal();
        Editor editor(direct, author);
        for (int i = 0; i < edits; ++i) editor.edit();
        const auto set = direct.seal();
        const std::size_t maximum = set ? set->changes.size() : 0;
        const std::string after = savedText(direct);
        Followed scene(before);
        const std::size_t count = scene.followWhole(after);
        followed += count;
        created += maximum;
        EXPECT_LE(count, edits == 1 ? maximum : SIZE_MAX) << before << "\n---\n" << after;
        if (const auto all = scene.follow(before)) {
            for (const Change& one : all->changes) EXPECT_NE(one.kind, ChangeKind::defineType);
        }
        Scene again;
        Followed::read(again, before);
        EXPECT_EQ(test::canonicalText(scene.scene), test::canonicalText(again)) << "taken back";
        if (testing::Test::HasFailure()) return;
    }
    EXPECT_LE(static_cast<double>(followed), 1.1 * static_cast<double>(created));
    EXPECT_GT(followed, 100U);
    RecordProperty("changes", std::to_string(followed) + " of " + std::to_string(created));
}
INSTANTIATE_TEST_SUITE_P(Counts, AnyEdit, testing::Values(1, 2, 5, 20));

/// From any document to any other.
TEST(EditedDocument, AnyDocumentLeadsToAnyOther) {
    Followed followed("Group { }");
    for (std::uint32_t seed = 1; seed <= 60; ++seed) {
        SCOPED_TRACE(testing::Message() << "seed " << seed);
        std::string text = Author(seed).document();
        followed.followWhole(text);
        if (testing::Test::HasFailure()) return;
    }
}

}  // namespace
}  // namespace rtsg
