// Addresses of sessions at NATS servers: what they say, and what is said of them.
#include <gtest/gtest.h>

#include <rtsg/nats/nats_address.h>
#include <rtsg/nats/nats_subscriber.h>

#include "link/open_nats.h"

namespace rtsg {
namespace {

TEST(NatsAddress, NamesServersAndASession) {
    const auto address = NatsAddress::parse("nats://anna:se/c:ret@one:4223,two/hall-1_A");
    ASSERT_TRUE(address) << address.error().format();
    EXPECT_EQ(address->servers,
              (std::vector<std::string>{"nats://anna:se/c:ret@one:4223", "nats://anna:se/c:ret@two"}));
    EXPECT_EQ(address->name, "hall-1_A");
    EXPECT_EQ(address->shown, "nats://one:4223,two/hall-1_A");
    EXPECT_EQ(NatsAddress::parse("tls://[::1]:4222/x")->servers.front(), "tls://[::1]:4222");
    EXPECT_EQ(withoutSecrets("bad user anna:se/c:ret at se/c:ret", *address), "bad user *** at ***");
    EXPECT_TRUE(isNatsAddress("tls://h/x"));
    EXPECT_FALSE(isNatsAddress("tcp://h:1"));
}

TEST(NatsAddress, RefusesWhatIsNone) {
    for (const char* text : {"nats://", "nats://host", "nats://host/", "nats:///hall", "nats://host/a.b",
                             "nats://host/a b", "nats://host/>", "nats://host:0/a", "nats://host:70000/a",
                             "nats://host:4x/a", "nats://one,,two/a", "tcp://host:1/a", "nats://u:p@/a"}) {
        const auto address = NatsAddress::parse(text);
        EXPECT_FALSE(address) << text;
        EXPECT_EQ(address.error().format().find("u:p"), std::string::npos) << "no secret is repeated";
    }
    EXPECT_FALSE(NatsAddress::parse("nats://host/" + std::string(65, 'a')));
    EXPECT_TRUE(NatsAddress::parse("nats://host/" + std::string(64, 'a')));
}

TEST(NatsAddress, WithoutAServerTheReasonIsSaidAndNoPassword) {
    const auto none = NatsSubscriber::start("nats://anna:secret@127.0.0.1:1/hall");
    ASSERT_FALSE(none);
    EXPECT_NE(none.error().format().find("no connection to the NATS server"), std::string::npos)
        << none.error().format();
    EXPECT_EQ(none.error().format().find("secret"), std::string::npos) << none.error().format();
}

}  // namespace
}  // namespace rtsg
