// Which servers are public, and which addresses are below which: rtsg/fetch/fetch_rules.h.
#include <rtsg/fetch/fetch_rules.h>

#include <cstring>

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <netinet/in.h>
#include <sys/un.h>

namespace rtsg {
namespace {

using testing::HasSubstr;

sockaddr_storage serverAt(const std::string& number) {
    sockaddr_storage result{};
    if (number.contains(':')) {
        auto& six = reinterpret_cast<sockaddr_in6&>(result);
        six.sin6_family = AF_INET6;
        EXPECT_EQ(inet_pton(AF_INET6, number.c_str(), &six.sin6_addr), 1) << number;
    } else {
        auto& four = reinterpret_cast<sockaddr_in&>(result);
        four.sin_family = AF_INET;
        EXPECT_EQ(inet_pton(AF_INET, number.c_str(), &four.sin_addr), 1) << number;
    }
    return result;
}

bool isPublicNumber(const std::string& number) {
    const sockaddr_storage server = serverAt(number);
    return isPublic(reinterpret_cast<const sockaddr&>(server));
}

TEST(FetchRules, ServersThatAreNotPublic) {
    for (const char* number : {"0.0.0.0",
                               "0.1.2.3",
                               "10.0.0.1",
                               "10.255.255.255",
                               "100.64.0.1",
                               "100.127.255.255",
                               "127.0.0.1",
                               "127.255.0.1",
                               "169.254.169.254",
                               "172.16.0.1",
                               "172.31.255.255",
                               "192.0.0.8",
                               "192.0.2.1",
                               "192.168.1.1",
                               "198.18.0.1",
                               "198.19.255.255",
                               "198.51.100.7",
                               "203.0.113.7",
                               "224.0.0.1",
                               "239.255.255.255",
                               "240.0.0.1",
                               "255.255.255.255",
                               "::",
                               "::1",
                               "::127.0.0.1",
                               "::ffff:127.0.0.1",
                               "::ffff:10.0.0.1",
                               "64:ff9b::7f00:1",
                               "64:ff9b::a00:1",
                               "2002:7f00:1::",
                               "2002:c0a8:101::1",
                               "2001::1",
                               "2001:db8::1",
                               "fc00::1",
                               "fd12:3456::1",
                               "fe80::1",
                               "fec0::1",
                               "ff02::1",
                               "100::1",
                               "3fff::1",
                               "4000::1"})
        EXPECT_FALSE(isPublicNumber(number)) << number;
}

TEST(FetchRules, ServersThatArePublic) {
    for (const char* number :
         {"1.1.1.1", "8.8.8.8", "9.255.255.255", "11.0.0.1", "100.63.255.255", "100.128.0.1", "126.0.0.1", "128.0.0.1",
          "172.15.255.255", "172.32.0.1", "192.167.0.1", "192.169.0.1", "223.255.255.255", "2606:4700::1111",
          "2a00:1450::1", "::ffff:8.8.8.8", "64:ff9b::808:808", "2002:808:808::1", "2001:4860::8888"})
        EXPECT_TRUE(isPublicNumber(number)) << number;
    sockaddr_un file{};
    file.sun_family = AF_UNIX;
    EXPECT_FALSE(isPublic(reinterpret_cast<const sockaddr&>(file)));
}

TEST(FetchRules, Networks) {
    const auto network = IpNetwork::parse("10.1.0.0/16");
    ASSERT_TRUE(network);
    FetchRules rules;
    rules.networks = {*network};
    const auto may = [&](const std::string& number, const char* address = "http://wiki.corp/") {
        const sockaddr_storage server = serverAt(number);
        return rules.mayConnect(*WebAddress::parse(address), reinterpret_cast<const sockaddr&>(server));
    };
    EXPECT_TRUE(may("10.1.2.3"));
    EXPECT_TRUE(may("::ffff:10.1.2.3"));
    EXPECT_FALSE(may("10.2.0.1"));
    EXPECT_TRUE(may("8.8.8.8"));
    // A rule with a number allows this number only.
    EXPECT_TRUE(may("192.168.1.5", "http://192.168.1.5/"));
    EXPECT_FALSE(may("192.168.1.6", "http://192.168.1.5/"));
    EXPECT_TRUE(may("::1", "http://[::1]/"));
    EXPECT_TRUE(may("127.0.0.1", "http://localhost/"));
    EXPECT_TRUE(may("::1", "http://localhost/"));
    EXPECT_FALSE(may("10.2.0.1", "http://localhost/"));
    EXPECT_FALSE(may("127.0.0.1", "http://sub.localhost/"));
    for (const char* wrong :
         {"", "10.0.0.0/33", "10.0.0.0/-1", "10.0.0.0/", "10.0.0.0/8x", "fd00::/129", "corp", "10.0"})
        EXPECT_FALSE(IpNetwork::parse(wrong)) << wrong;
    EXPECT_EQ(IpNetwork::parse("fd00::/8")->bits, 8);
    EXPECT_EQ(IpNetwork::parse("10.0.0.0/8")->bits, 104);
}

TEST(FetchRules, ARefusalNamesTheFolder) {
    FetchRules rules;
    const auto refused = rules.check(*WebAddress::parse("https://example.org/a/b.x3d?q=1/2"));
    ASSERT_FALSE(refused);
    EXPECT_THAT(refused.error().text, HasSubstr("--allow https://example.org/a/ lets it"));
    rules.allowed = {*WebAddress::parse("https://example.org/a")};
    EXPECT_TRUE(rules.check(*WebAddress::parse("https://example.org/a/b.x3d?q=1/2")));
    EXPECT_FALSE(rules.check(*WebAddress::parse("http://example.org/a/b.x3d")));
    EXPECT_FALSE(rules.check(*WebAddress::parse("https://example.org/ab.x3d")));
}

}  // namespace
}  // namespace rtsg
