// Control characters and bytes that are no UTF-8 on their way to a terminal.
#include <gtest/gtest.h>

#include <rtsg/core/field_text.h>
#include <rtsg/core/terminal.h>

namespace rtsg {
namespace {

TEST(AsUtf8, ReplacesWhatIsNone) {
    EXPECT_EQ(asUtf8("plain, grüße, 日本, 🙂"), "plain, grüße, 日本, 🙂");
    EXPECT_EQ(asUtf8("a\xff"
                     "b\xc3"),
              "a\xEF\xBF\xBD"
              "b\xEF\xBF\xBD");
    EXPECT_EQ(asUtf8(""), "");
}

TEST(TerminalText, ControlCharactersAreShown) {
    EXPECT_EQ(terminalText("plain, grüße, 日本, 🙂"), "plain, grüße, 日本, 🙂");
    EXPECT_EQ(terminalText("\x1b[2Jgone"), "\\x1b[2Jgone");
    EXPECT_EQ(terminalText("a\nb\tc\rd"), "a\\nb\\x09c\\x0dd");
    EXPECT_EQ(terminalText("a\nb\tc\rd", Lines::kept), "a\nb\tc\\x0dd");
    EXPECT_EQ(terminalText("\x7f|\xc2\x9b|\xc2\xa0"), "\\x7f|\\x9b|\xc2\xa0");
    EXPECT_EQ(terminalText("a\u202Eb\u2028"), "a\\u{202e}b\\u{2028}");
    EXPECT_EQ(terminalText(std::string_view("\0x", 2)), "\\x00x");
}

TEST(TerminalText, BytesThatAreNoUtf8AreShown) {
    // A bare 0x9B starts a sequence of commands on some terminals.
    EXPECT_EQ(terminalText("\x9b[2J"), "\\x9b[2J");
    EXPECT_EQ(terminalText("\xe6\x97"), "\\xe6\\x97");
    EXPECT_EQ(terminalText("\xff"), "\\xff");
}

TEST(TerminalText, JsonEscapesTheSame) {
    EXPECT_EQ(printFieldText(Value(String("\x1b\x7f\xc2\x9b\xc2\xa0 \n")), TextSyntax::json),
              "\"\\u001b\\u007f\\u009b\xc2\xa0 \\n\"");
}

}  // namespace
}  // namespace rtsg
