// Warnings about urls that lead to nothing, with the positions at which the document names them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/documents/loader.h>
#include <rtsg/documents/resource_check.h>
#include <rtsg/documents/scene_builder.h>

#include "core/scene_check.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

using testing::HasSubstr;

/// With positions, where a list of them was kept.
std::string missingFiles(const std::string& text, bool withPositions) {
    const test::TempFolder folder;
    Scene scene;
    Diagnostics problems("test"), missing("test");
    BuildOptions options;
    options.resources = Resources(folder.path());
    SceneBuilder builder(scene, problems, options);
    UrlLocations locations(builder);
    readDocument(text, locations, problems);
    builder.finish();
    checkResources(scene, *options.resources, missing, withPositions ? &locations : nullptr);
    return test::allText(missing);
}

constexpr const char* kTwoPictures =
    "#X3D V4.0 utf8\nPROFILE Full\n"
    "Shape { appearance Appearance { texture DEF A ImageTexture {\n  url [ \"a.png\" \"b.png\" ] } } }\n"
    "Shape { appearance Appearance { texture ImageTexture {\n\n    url \"a.png\" } } }\n"
    "Shape { appearance Appearance { texture DEF C ImageTexture {\n     url \"a.png\" } } }\n";

TEST(ResourceCheck, SaysWhereADocumentNamesWhatIsNotThere) {
    const std::string text = missingFiles(kTwoPictures, true);
    EXPECT_THAT(text, HasSubstr("test:4:3: warning: ImageTexture A.url: 'a.png' is not there"));
    EXPECT_THAT(text, HasSubstr("test:7:5: warning: ImageTexture.url: 'a.png' is not there"));
    EXPECT_THAT(text, HasSubstr("test:9:6: warning: ImageTexture C.url: 'a.png' is not there"));
}

TEST(ResourceCheck, AnInstanceOfAPrototypeLeadsToItsBody) {
    const std::string text = missingFiles(
        "#X3D V4.0 utf8\nPROFILE Full\nPROTO P [ ] { Appearance { texture ImageTexture {\n url \"x.png\" } } }\n"
        "Shape { appearance P { } }\nShape { appearance P { } }\n",
        true);
    // The same words at the same position are reported once.
    EXPECT_THAT(text, HasSubstr("test:4:2: warning: ImageTexture.url: 'x.png' is not there"));
    EXPECT_EQ(text.find("warning"), text.rfind("warning"));
}

TEST(ResourceCheck, HasNoPlacesWithoutADocument) {
    EXPECT_THAT(missingFiles(kTwoPictures, false), HasSubstr("test: warning: ImageTexture A.url"));
}

}  // namespace
}  // namespace rtsg
