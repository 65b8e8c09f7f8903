// Random commands and random documents: nothing breaks the builder, and every document survives saving and loading.
#include <random>

#include <rtsg/documents/command_list.h>
#include <rtsg/documents/scene_builder.h>
#include <rtsg/documents/scene_exporter.h>
#include <rtsg/documents/writer.h>

#include "core/scene_check.h"

namespace rtsg {
namespace {

class Random {
  public:
    explicit Random(std::uint32_t seed) : engine_(seed) {}
    std::size_t below(std::size_t count) { return std::uniform_int_distribution<std::size_t>(0, count - 1)(engine_); }
    bool chance(double probability) { return std::bernoulli_distribution(probability)(engine_); }
    float number() { return std::uniform_real_distribution<float>(-10, 10)(engine_); }
    template <std::size_t N>
    std::string_view oneOf(const char* const (&list)[N]) {
        return list[below(N)];
    }

  private:
    std::mt19937 engine_;
};

constexpr const char* kTypes[] = {"Group",  "Transform", "Shape", "Box",         "Appearance", "Material",
                                  "Script", "Inline",    "P",     "Q",           "R",          "TimeSensor",
                                  "Switch", "Nonsense",  "",      "MetadataSet", "Viewpoint",  "ComposedShader"};
constexpr const char* kFields[] = {"children",
                                   "geometry",
                                   "appearance",
                                   "material",
                                   "translation",
                                   "set_translation",
                                   "size",
                                   "body",
                                   "metadata",
                                   "value",
                                   "a",
                                   "b",
                                   "c",
                                   "url",
                                   "load",
                                   "enabled",
                                   "",
                                   "addChildren"};
constexpr const char* kNames[] = {"A", "B", "C", "D", ""};

Value randomValue(Random& random) {
    switch (random.below(9)) {
        case 0:
            return Value(true);
        case 1:
            return Value(random.number());
        case 2:
            return Value(Vec3f(random.number()));
        case 3:
            return Value(Array<String>{String("x.x3d"), String("http://a/b")});
        case 4:
            return Value(NodeId{});
        case 5:
            return Value(NodeId{static_cast<std::uint32_t>(random.below(20))});
        case 6:
            return Value(Array<NodeId>{NodeId{2}, NodeId{77}});
        case 7:
            return Value(Rotation{0, 0, 0, random.number()});
        default:
            return Value(std::int32_t{3});
    }
}

FieldDeclaration randomDeclaration(Random& random) {
    constexpr FieldType types[] = {FieldType::SFBool, FieldType::SFFloat,  FieldType::SFVec3f,   FieldType::SFNode,
                                   FieldType::MFNode, FieldType::MFString, FieldType::SFRotation};
    return {static_cast<Access>(random.below(4)), types[random.below(std::size(types))],
            std::string(random.oneOf(kFields))};
}

void sendRandomCommand(Random& random, DocumentHandler& handler, std::uint32_t line) {
    const SourceLocation at{line, 1};
    switch (random.below(20)) {
        case 0:
        case 1:
        case 2:
        case 3:
            return handler.beginNode(random.oneOf(kTypes), random.oneOf(kNames), random.oneOf(kFields), at);
        case 4:
        case 5:
        case 6:
        case 7:
            return handler.endNode(at);
        case 8:
            return handler.useNode(random.oneOf(kNames), random.oneOf(kFields), at);
        case 9:
        case 10:
            return handler.setField(random.oneOf(kFields), randomValue(random), at);
        case 11:
            return handler.declareField(randomDeclaration(random),
                                        random.chance(0.5) ? std::optional(randomValue(random)) : std::nullopt, at);
        case 12:
            return handler.isConnection(random.oneOf(kFields), random.oneOf(kFields), at);
        case 13:
            return handler.beginProto(random.oneOf(kTypes), at);
        case 14:
            return handler.beginProtoBody(at);
        case 15:
            return handler.endProto(at);
        case 16:
            return handler.externProto(random.oneOf(kTypes), {randomDeclaration(random)}, {"nowhere.x3dv#X"}, at);
        case 17:
            return handler.route(random.oneOf(kNames), random.oneOf(kFields), random.oneOf(kNames),
                                 random.oneOf(kFields), at);
        case 18:
            return random.chance(0.5)
                       ? handler.importNode(random.oneOf(kNames), random.oneOf(kNames), random.oneOf(kNames), at)
                       : handler.exportNode(random.oneOf(kNames), random.oneOf(kNames), at);
        default:
            return random.chance(0.1) ? handler.endDocument() : handler.beginDocument({});
    }
}

std::string saved(const Scene& scene, Encoding encoding) {
    std::string text;
    Diagnostics problems("export");
    const auto writer = makeWriter(encoding, [&](std::string_view piece) { text += piece; }, problems);
    SceneExporter(scene, problems).write(*writer, encoding);
    return text;
}

void expectReplicaIsEqual(Scene& scene) {
    scene.seal();
    Scene replica;
    const auto applied = replica.apply(std::make_shared<ChangeSet>(scene.snapshot()));
    ASSERT_TRUE(applied) << applied.error().text;
    ASSERT_EQ(replica.dump(), scene.dump());
}

class RandomDocument : public testing::TestWithParam<std::uint32_t> {};

TEST_P(RandomDocument, NoOrderOfCommandsBreaksTheBuilder) {
    SCOPED_TRACE(testing::Message() << "seed " << GetParam());
    Random random(GetParam());
    Scene scene;
    Diagnostics diagnostics("random");
    BuildOptions options;
    ResourcePolicy policy;
    policy.maximumNodes = 2000;
    options.resources = Resources({}, policy);
    CommandList recorded;
    {
        SceneBuilder builder(scene, diagnostics, options);
        for (std::uint32_t line = 1; line <= 400; ++line) sendRandomCommand(random, recorded, line);
        recorded.replay(builder);
        builder.finish();
    }
    expectReplicaIsEqual(scene);
    scene.newFrame(1);
    expectReplicaIsEqual(scene);
    (void)saved(scene, Encoding::classicVrml);
    (void)saved(scene, Encoding::xml);
    // The same commands make the same scene.
    Scene again;
    Diagnostics more("random");
    SceneBuilder builder(again, more, options);
    recorded.replay(builder);
    builder.finish();
    EXPECT_EQ(test::allText(more), test::allText(diagnostics));
}

/// Writes a valid document: a tree of groups, shapes and PROTO instances with sharing, routes and Scripts.
class Generator {
  public:
    explicit Generator(std::uint32_t seed) : random_(seed) {}

    std::string document() {
        std::string text = "PROFILE Immersive\nMETA \"seed\" \"x\"\n";
        const std::size_t protos = random_.below(4);
        for (std::size_t i = 0; i < protos; ++i) text += proto();
        const std::size_t roots = 1 + random_.below(5);
        for (std::size_t i = 0; i < roots; ++i) text += node(0);
        for (int i = 0; i < 6 && transforms_.size() > 1; ++i)
            text +=
                fmt::format("ROUTE {}.{} TO {}.{}\n", any(transforms_), random_.chance(0.5) ? "translation" : "center",
                            any(transforms_), random_.chance(0.5) ? "set_translation" : "scale");
        return text;
    }

  private:
    const std::string& any(const std::vector<std::string>& list) { return list[random_.below(list.size())]; }
    std::string vec() { return fmt::format("{} {} {}", random_.number(), random_.number(), random_.number()); }
    std::string fresh(char kind) { return fmt::format("{}{}", kind, ++count_); }

    std::string proto() {
        const std::string name = fresh('P');
        std::string body = "Transform { translation IS at children [ ";
        if (random_.chance(0.5)) body += "DEF In Group { children IS kids } ";
        if (!protos_.empty() && random_.chance(0.7)) body += fmt::format("{} {{ at IS at }} ", any(protos_));
        if (random_.chance(0.3)) body += "DEF S Script { inputOutput SFVec3f v IS at outputOnly SFVec3f o } ";
        body += "DEF T Transform { } ] } ";
        if (random_.chance(0.3)) body += "DEF C TimeSensor { } ROUTE C.startTime TO C.stopTime ";
        if (random_.chance(0.3)) body = "PROTO Local [ ] { Group { } } " + body + "Local { } ";
        const std::string text =
            fmt::format("PROTO {} [ inputOutput SFVec3f at {} initializeOnly MFNode kids [ {} ] ] {{ {} }}\n", name,
                        vec(), random_.chance(0.5) ? "DEF K Shape { }" : "", body);
        protos_.push_back(name);
        return text;
    }

    std::string kids(int depth) {
        std::string text = "[ ";
        for (std::size_t i = random_.below(4); i > 0; --i) text += node(depth + 1);
        return text + "] ";
    }

    std::string node(int depth) {
        if (!done_.empty() && depth > 0 && random_.chance(0.2)) return "USE " + any(done_) + " ";
        std::string name, text;
        switch (random_.below(depth < 5 ? 6 : 3)) {
            case 0:
                text = fmt::format(
                    "DEF {} Shape {{ appearance Appearance {{ material DEF {} Material {{ shininess {} }} }} "
                    "geometry Box {{ size 1 2 {} }} }}\n",
                    name = fresh('S'), fresh('M'), random_.below(100) / 100.0, 1 + random_.below(9));
                break;
            case 1:
                name = fresh('J');
                text = fmt::format(
                    "DEF {} Script {{ inputOutput SFVec3f v {} outputOnly SFTime t initializeOnly SFNode me USE {} "
                    "initializeOnly MFString s [ \"a b\" \"\\\"q\\\"\" ] }}\n",
                    name, vec(), name);
                break;
            case 2:
                if (protos_.empty()) {
                    text = "WorldInfo { title \"t\" info [ \"1\", \"2\" ] }\n";
                    break;
                }
                name = fresh('I');
                text = fmt::format("DEF {} {} {{ {} {} }}\n", name, any(protos_),
                                   random_.chance(0.5) ? "at " + vec() : std::string(),
                                   random_.chance(0.5) ? "kids " + kids(depth) : std::string());
                break;
            default: {
                name = fresh('T');
                const std::string own = name;
                text = fmt::format("DEF {} Transform {{ translation {} rotation 0 1 0 {} children {} }}\n", own, vec(),
                                   random_.number(), kids(depth));
                transforms_.push_back(own);
                break;
            }
        }
        if (!name.empty()) done_.push_back(name);
        return text;
    }

    Random random_;
    std::size_t count_ = 0;
    std::vector<std::string> protos_, transforms_, done_;
};

TEST_P(RandomDocument, SavingAndLoadingKeepsIt) {
    SCOPED_TRACE(testing::Message() << "seed " << GetParam());
    test::Loaded l(Generator(GetParam()).document());
    ASSERT_EQ(l.problems(), "") << Generator(GetParam()).document();
    const std::string canonical = test::canonicalText(l.scene);
    for (const Encoding encoding : {Encoding::classicVrml, Encoding::xml}) {
        const std::string text = saved(l.scene, encoding);
        Scene again;
        Diagnostics problems;
        loadText(again, text, problems);
        ASSERT_EQ(test::allText(problems), "") << text;
        ASSERT_EQ(test::canonicalText(again), canonical) << text;
        ASSERT_EQ(saved(again, encoding), text);
    }
    l.scene.seal();
    Scene replica;
    ASSERT_TRUE(replica.apply(std::make_shared<ChangeSet>(l.scene.snapshot())));
    ASSERT_EQ(saved(replica, Encoding::xml), saved(l.scene, Encoding::xml));
}

INSTANTIATE_TEST_SUITE_P(Seeds, RandomDocument, testing::Range(0u, 40u));

}  // namespace
}  // namespace rtsg
