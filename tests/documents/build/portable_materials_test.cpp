// Prototypes behind urns of portable materials.
#include <rtsg/core/x3d.h>
#include <rtsg/documents/filter.h>
#include <rtsg/documents/loader.h>
#include <rtsg/documents/read_document.h>

#include <gmock/gmock.h>

#include "build/portable_materials.h"
#include "core/scene_check.h"
#include "test_paths.h"

namespace rtsg {
namespace {

using testing::HasSubstr;

const std::string kMaterialsFile = RTSG_SOURCE_DIR "/examples/materials/materials.x3dv";

/// The interfaces of a document's prototypes, a line for each name and field.
struct Interfaces final : Filter {
    std::vector<std::string> lines;
    std::vector<std::string> names;
    void beginProto(std::string_view name, SourceLocation) override {
        names.emplace_back(name);
        lines.emplace_back(name);
    }
    void declareField(const FieldDeclaration& field, std::optional<Value> value, SourceLocation) override {
        lines.push_back(fmt::format("{} {} {} {}", static_cast<int>(field.access), info(field.type).name, field.name,
                                    value ? printFieldText(*value) : ""));
    }
};
Interfaces interfacesOf(std::string_view text) {
    Interfaces result;
    Diagnostics diagnostics;
    EXPECT_TRUE(readDocument(text, result, diagnostics));
    EXPECT_EQ(test::allText(diagnostics), "");
    return result;
}

TEST(PortableMaterials, TheFileForOthersHasTheSameInterfaces) {
    Interfaces file;
    Diagnostics diagnostics;
    ASSERT_TRUE(readDocumentFile(kMaterialsFile, file, diagnostics));
    EXPECT_EQ(test::allText(diagnostics), "");
    EXPECT_EQ(file.lines, interfacesOf(detail::kPortableMaterials).lines);
    EXPECT_EQ(file.names.size(), 5u);
}

TEST(PortableMaterials, EveryNameIsKnownByItsUrn) {
    for (const std::string& name : interfacesOf(detail::kPortableMaterials).names) {
        const test::Loaded l("EXTERNPROTO Own [ ] [ \"urn:rtsg:material:" + name +
                             "\" \"none.x3dv\" ]\nShape { appearance Appearance { material DEF M Own { } } }");
        EXPECT_EQ(test::allText(l.diagnostics), "") << name;
        const Node* material = l.scene.effectiveNode(l.named("M"));
        ASSERT_TRUE(material) << name;
        EXPECT_TRUE(material->type().isA("X3DMaterialNode")) << name;
    }
}

TEST(PortableMaterials, OtherNamesAreToldOrTheNextUrlIsTaken) {
    const test::Loaded alone("EXTERNPROTO Wood [ ] [ \"urn:rtsg:material:Wood\" ]\nWood { }");
    EXPECT_THAT(test::allText(alone.diagnostics), HasSubstr("'urn:rtsg:material:Wood' declares no PROTO Wood"));
    const test::Loaded next(
        "EXTERNPROTO Wood [ ] [ \"urn:rtsg:material:Wood\" \"data:model/x3d+vrml,%23X3D V4.0 utf8%0APROFILE "
        "Full%0APROTO "
        "P [ ] { Material { } }\" ]\nShape { appearance Appearance { material DEF M Wood { } } }");
    EXPECT_EQ(test::allText(next.diagnostics), "");
    EXPECT_TRUE(next.scene.effectiveNode(next.named("M"))->is(x3d::Material::type));
}

TEST(PortableMaterials, FieldsReachTheMetadataWhileTheSceneRuns) {
    test::Loaded l(
        "EXTERNPROTO Mirror [ inputOutput MFFloat reflectivity ] [ \"urn:rtsg:material:Mirror\" ]\n"
        "Shape { appearance Appearance { material DEF M Mirror { reflectivity .9 } } }");
    ASSERT_EQ(test::allText(l.diagnostics), "");
    const NodeId instance = l.named("M");
    const auto reflectivity = [&] {
        const Node& material = *l.scene.effectiveNode(instance);
        const Node& set = l.scene.node(material.get(x3d::Material::metadata));
        return l.scene.node(set.get(x3d::MetadataSet::value)[0]).get(x3d::MetadataFloat::value);
    };
    EXPECT_EQ(reflectivity(), Array<float>{.9f});
    const FieldIndex field = l.scene.node(instance).type().find("reflectivity");
    ASSERT_TRUE(l.scene.setField(instance, field, Value(Array<float>{.5f})));
    l.scene.newFrame(1);
    EXPECT_EQ(reflectivity(), Array<float>{.5f});
}

}  // namespace
}  // namespace rtsg
