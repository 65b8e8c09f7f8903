// One form of addresses, and relative ones: rtsg/core/web_address.h.
#include <rtsg/core/web_address.h>

#include <gmock/gmock.h>

#include <rtsg/core/resource.h>

namespace rtsg {
namespace {

using testing::HasSubstr;

std::string formOf(std::string_view text) {
    const auto address = WebAddress::parse(text);
    return address ? address->text() : "refused: " + address.error().text;
}

TEST(WebAddress, OneForm) {
    EXPECT_EQ(formOf("HTTPS://Example.ORG"), "https://example.org/");
    EXPECT_EQ(formOf("https://example.org:443/a"), "https://example.org/a");
    EXPECT_EQ(formOf("http://example.org:80?q"), "http://example.org/?q");
    EXPECT_EQ(formOf("http://example.org:8080/a#b"), "http://example.org:8080/a");
    EXPECT_EQ(formOf("http://example.org./"), "http://example.org/");
    EXPECT_EQ(formOf("http://[0:0::1]:80/"), "http://[::1]/");
    EXPECT_EQ(formOf("http://h/a b/\xC3\xA4\\\"?x=<y>"), "http://h/a%20b/%C3%A4%5C%22?x=%3Cy%3E");
    EXPECT_EQ(formOf("http://h/%41%zz%"), "http://h/%41%25zz%25");
    EXPECT_EQ(formOf("http://h/a\r\nX-Header: b"), "http://h/a%0D%0AX-Header:%20b");
    EXPECT_EQ(formOf("http://h/a/./b/../c/.."), "http://h/a/");
    EXPECT_EQ(formOf("http://h/../../a"), "http://h/a");
    EXPECT_EQ(formOf("http://h/a/%2e%2E/b/%2e"), "http://h/b/");
    EXPECT_EQ(formOf("http://h/a?b=../c"), "http://h/a?b=../c");
    EXPECT_EQ(formOf("http://h//a//b"), "http://h//a//b");
}

TEST(WebAddress, WhatIsNone) {
    for (const char* text : {"ftp://h/", "http:/h", "//h/a", "a.x3d", ""})
        EXPECT_THAT(formOf(text), HasSubstr("it begins neither with http:// nor with https://")) << text;
    for (const char* text : {"http://user@h/", "http://user:word@h/", "http://a@b@h/", "https://h\\@evil/"})
        EXPECT_THAT(formOf(text), HasSubstr("refused: ")) << text;
    for (const char* text :
         {"http:///a", "http://", "http://h%41/", "http://h h/", "http://\xC3\xA4.org/", "http://-h/", "http://[::1/",
          "http://[x]/", "http://::1/", "http://h:0/", "http://h:65536/", "http://h:8a/", "http://[::1]x/"})
        EXPECT_THAT(formOf(text), HasSubstr("refused: ")) << text;
    EXPECT_THAT(formOf("http://h/" + std::string(9000, 'a')), HasSubstr("more than 8000 bytes"));
    EXPECT_THAT(formOf("http://" + std::string(300, 'a') + "/"), HasSubstr("refused: "));
}

TEST(WebAddress, RelativeOnes) {
    // The examples of RFC 3986, 5.4.
    const auto base = WebAddress::parse("http://a/b/c/d;p?q");
    const std::pair<const char*, const char*> cases[] = {
        {"g", "http://a/b/c/g"},       {"./g", "http://a/b/c/g"},
        {"g/", "http://a/b/c/g/"},     {"/g", "http://a/g"},
        {"//g", "http://g/"},          {"?y", "http://a/b/c/d;p?y"},
        {"g?y", "http://a/b/c/g?y"},   {"g#s", "http://a/b/c/g"},
        {";x", "http://a/b/c/;x"},     {"", "http://a/b/c/d;p?q"},
        {".", "http://a/b/c/"},        {"./", "http://a/b/c/"},
        {"..", "http://a/b/"},         {"../", "http://a/b/"},
        {"../g", "http://a/b/g"},      {"../..", "http://a/"},
        {"../../g", "http://a/g"},     {"../../../g", "http://a/g"},
        {"/./g", "http://a/g"},        {"/../g", "http://a/g"},
        {"g.", "http://a/b/c/g."},     {"..g", "http://a/b/c/..g"},
        {"./../g", "http://a/b/g"},    {"g/./h", "http://a/b/c/g/h"},
        {"g/../h", "http://a/b/c/h"},  {"g?y/../x", "http://a/b/c/g?y/../x"},
        {"https://g/h", "https://g/h"}};
    for (const auto& [reference, expected] : cases) {
        const auto resolved = base->resolve(reference);
        EXPECT_EQ(resolved ? resolved->text() : resolved.error().text, expected) << reference;
    }
}

TEST(WebAddress, Below) {
    const auto below = [](const char* address, const char* prefix) {
        return WebAddress::parse(address)->isBelow(*WebAddress::parse(prefix));
    };
    EXPECT_TRUE(below("https://h/a/b", "https://h/"));
    EXPECT_TRUE(below("https://h/a/b", "https://h/a"));
    EXPECT_TRUE(below("https://h/a", "https://h/a"));
    EXPECT_TRUE(below("https://h/a?q", "https://h/a"));
    EXPECT_FALSE(below("https://h/ab", "https://h/a"));
    EXPECT_FALSE(below("https://h/a", "https://h/a/"));
    EXPECT_FALSE(below("http://h/a", "https://h/"));
    EXPECT_FALSE(below("https://h:444/a", "https://h/"));
    EXPECT_FALSE(below("https://h.evil/a", "https://h/"));
    EXPECT_FALSE(below("https://h/a/../b", "https://h/a/"));
}

TEST(WebAddress, FoldersAndJoins) {
    EXPECT_EQ(Resources().folderBehind({}, "https://h/a/b.x3d?c=/d#e"), "https://h/a");
    EXPECT_EQ(Resources().folderBehind({}, "https://h"), "https://h");
    EXPECT_EQ(Resources().folderBehind("https://h/a", "b/c.x3d"), "https://h/a/b");
    EXPECT_EQ(Resources().folderBehind("https://h/a", "/c.x3d"), "https://h");
    EXPECT_EQ(Resources().folderBehind("https://h/a", "file:///etc/c.x3d"), "");
    EXPECT_EQ(Resources().folderBehind("/x", "https://h/a/b.x3d"), "https://h/a");
    EXPECT_EQ(Resources("https://h/a/").folder(), "https://h/a");
    EXPECT_EQ(Resources::ofFile("https://h/a/b.x3d").folder(), "https://h/a");
    EXPECT_EQ(joinUrls("https://h/a/b.x3d", "../c.x3d#d"), "https://h/c.x3d");
    EXPECT_EQ(joinUrls("https://h/a/b.x3d", "/c.x3d"), "https://h/c.x3d");
    EXPECT_EQ(joinUrls("https://h/a/b.x3d", "file:///c.x3d"), "file:///c.x3d");
    EXPECT_EQ(joinUrls("a/b.x3d", "https://h/c.x3d#d"), "https://h/c.x3d");
}

TEST(WebAddress, DocumentsOnTheNetworkNameNoFiles) {
    ResourcePolicy policy;
    policy.roots = {"/"};
    const Resources resources("https://h/a", policy);
    for (const char* url : {"file:///etc/passwd", "FILE:/etc/passwd"}) {
        const auto opened = resources.open("https://h/a", url);
        ASSERT_FALSE(opened) << url;
        EXPECT_THAT(opened.error().text, HasSubstr("the document that names it is on the network")) << url;
    }
    for (const char* url : {"/etc/passwd", "../../etc/passwd", "//etc/passwd", "https://h/etc/passwd"}) {
        const auto opened = resources.open("https://h/a", url);
        ASSERT_FALSE(opened) << url;
        EXPECT_THAT(opened.error().text, HasSubstr("nothing is fetched from a network")) << url;
    }
    EXPECT_FALSE(resources.open("https://h/a", ""));
    EXPECT_TRUE(resources.open("https://h/a", "data:text/plain,yes"));
}

TEST(Base64, ComesBackWhateverItsLength) {
    const auto encoded = [](const std::string& bytes) { return base64(std::as_bytes(std::span(bytes))); };
    EXPECT_EQ(encoded("any carnal pleas"), "YW55IGNhcm5hbCBwbGVhcw==");
    std::string bytes;
    for (int i = 0; i < 300; ++i) {
        EXPECT_EQ(base64Decoded(encoded(bytes)), bytes);
        bytes += static_cast<char>(i * 7);
    }
    EXPECT_EQ(base64Decoded("a*b="), std::nullopt);
    EXPECT_EQ(base64Decoded("abcde"), std::nullopt);
}

}  // namespace
}  // namespace rtsg
