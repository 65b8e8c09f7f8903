// X3D in pages.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "documents/reading.h"

namespace rtsg {
namespace {

using test::Read;
using testing::HasSubstr;

TEST(ReaderHtml, TheX3dElementIsReadWhateverTheCaseOfItsNames) {
    const Read r(
        "<!DOCTYPE html>\n<html><head><title>a < b &nbsp;</title></head><body><p>text<br>\n<x3d width='100px'><scene>\n"
        "<transform def=T translation='1 2 3'><shape><appearance><material diffusecolor='1 0 "
        "0'></material></appearance>\n"
        "<box solid></box></shape></transform><shape><sphere/></shape>\n"
        "<worldinfo title='a & b &lt; c &amp; d' info='\"x\"'></worldinfo></scene></x3d><p>more</body></html>");
    EXPECT_EQ(
        r.handler.text(),
        "begin Transform DEF T\nset translation SFVec3f 1 2 3\nbegin Shape in children\nbegin Appearance in "
        "appearance\nbegin Material in material\nset diffuseColor SFColor 1 0 0\nend\nend\nbegin Box in geometry\n"
        "end\nend\nend\nbegin Shape\nbegin Sphere in geometry\nend\nend\nbegin WorldInfo\nset title SFString \"a & b < "
        "c & d\"\nset info MFString [\"x\"]\nend\n");
    EXPECT_THAT(r.complaints(), HasSubstr("test.x3d:5:")) << "lines are the page's";
}

TEST(ReaderHtml, ScriptsAndSeveralElements) {
    const Read r(
        "<html><body><X3D-canvas><X3D profile='Full' version='4.0'><Scene><Script DEF='S'>ecmascript: if (1 < 2 && a) "
        "f();</Script></Scene></X3D></X3D-canvas><X3D></X3D></body></html>");
    EXPECT_THAT(r.handler.text(), HasSubstr("\"ecmascript: if (1 < 2 && a) f();\""));
    EXPECT_THAT(r.complaints(), HasSubstr("more than one X3D element"));
}

TEST(ReaderHtml, PagesWithoutOneAndBrokenOnes) {
    EXPECT_THAT(Read("<!DOCTYPE html><html><body></body></html>").complaints(),
                HasSubstr("a page without an X3D element"));
    const std::string page =
        "<html><x3d><scene><shape def='a b' x=\"1\"><box size='1 2 3'/></shape><!-- c "
        "--><script>x</script></scene></x3d>";
    for (std::size_t size = 0; size <= page.size(); ++size) (void)Read(page.substr(0, size));
}

}  // namespace
}  // namespace rtsg
