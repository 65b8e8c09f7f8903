// Figures by HTTP: the text's form, and requests of all kinds.
#include <atomic>
#include <chrono>
#include <stdexcept>
#include <thread>
#include <utility>

#include <sys/socket.h>

#include <gtest/gtest.h>

#include <rtsg/feeds/metrics_server.h>

#include "sockets/endpoint.h"

namespace rtsg {

namespace {

std::string asked(const std::string& address, const std::string& request) {
    const auto endpoint = feeds::Endpoint::parse("tcp://" + address);
    const auto at = feeds::findAddress(*endpoint);
    const Descriptor socket(::socket(AF_INET, SOCK_STREAM, 0));
    const timeval patience = {60, 0};
    (void)::setsockopt(socket.get(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
    EXPECT_EQ(::connect(socket.get(), at->get(), at->length), 0);
    for (const char c : request)
        if (::send(socket.get(), &c, 1, MSG_NOSIGNAL) != 1) break;
    std::string answer;
    char bytes[4096];
    for (ssize_t size = 0; (size = ::recv(socket.get(), bytes, sizeof(bytes), 0)) > 0;)
        answer.append(bytes, static_cast<std::size_t>(size));
    return answer;
}

}  // namespace

TEST(MetricsText, HasEachNameOnceWithItsValues) {
    MetricsText text;
    text.add("a", MetricsText::Kind::gauge, "Of a.", 1.5);
    text.add("b_total", MetricsText::Kind::counter, "Of b.", 2, MetricsText::label("place", "x\"\\\ny"));
    text.add("b_total", MetricsText::Kind::counter, "Of b.", 3, MetricsText::label("place", "z"));
    const double bounds[] = {.1, 1};
    const std::uint64_t counts[] = {2, 0, 5};
    text.addHistogram("h", "Of h.", bounds, counts, 9.5);
    EXPECT_EQ(text.take(), R"(# HELP a Of a.
# TYPE a gauge
a 1.5
# HELP b_total Of b.
# TYPE b_total counter
b_total{place="x\"\\ y"} 2
b_total{place="z"} 3
# HELP h Of h.
# TYPE h histogram
h_bucket{le="0.1"} 2
h_bucket{le="1"} 2
h_bucket{le="+Inf"} 7
h_sum 9.5
h_count 7
)");
}

/// Bytes that come ever so slowly are no answer.
TEST(FetchMetrics, EndsWhereNoWholeAnswerComes) {
    auto endpoint = *feeds::Endpoint::parse("tcp://127.0.0.1:0");
    auto listening = feeds::listenAt(endpoint, false);
    ASSERT_TRUE(listening) << listening.error().text;
    std::atomic<bool> over{false};
    std::thread trickles([&] {
        Descriptor one;
        while (!over) {
            if (one.get() < 0) one = Descriptor(::accept(listening->get(), nullptr, nullptr));
            if (one.get() >= 0) (void)::send(one.get(), "a", 1, MSG_NOSIGNAL);
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
        }
    });
    const auto answer = fetchMetrics("127.0.0.1:" + std::to_string(endpoint.port));
    over = true;
    trickles.join();
    ASSERT_FALSE(answer);
    EXPECT_NE(answer.error().text.find("no whole answer has come for 5 s"), std::string::npos) << answer.error().text;
}

TEST(MetricsServer, AnswersWhatItHasAndRefusesTheRest) {
    int created = 0;
    const auto server = MetricsServer::start("0", false, [&] { return "a " + std::to_string(++created) + "\n"; });
    ASSERT_TRUE(server) << server.error().text;
    const std::string& at = (*server)->address();
    EXPECT_EQ(*fetchMetrics(at), "a 1\n");
    EXPECT_EQ(*fetchMetrics("http://" + at + "/metrics"), "a 2\n");
    const std::string host = " HTTP/1.1\r\nhOst: " + at + "\r\n", end = "\r\n";
    EXPECT_TRUE(asked(at, "GET /metrics?x=1" + host + end).ends_with("\r\n\r\na 3\n"));
    EXPECT_TRUE(asked(at, "HEAD /metrics" + host + end).ends_with("\r\n\r\n"));
    EXPECT_TRUE(asked(at, "GET /" + host + end).starts_with("HTTP/1.1 404 "));
    EXPECT_TRUE(asked(at, "POST /metrics" + host + end).starts_with("HTTP/1.1 405 "));
    EXPECT_TRUE(asked(at, "\r\n\r\n").starts_with("HTTP/1.1 400 "));
    EXPECT_TRUE(asked(at, "GET /" + std::string(5000, 'x')).starts_with("HTTP/1.1 431 "));
    EXPECT_EQ(created, 4);
}

TEST(MetricsServer, AnExceptionEndsOneAnswer) {
    bool throws = true;
    const auto server = MetricsServer::start("0", false, [&]() -> std::string {
        if (std::exchange(throws, false)) throw std::runtime_error("no figures now");
        return "a 1\n";
    });
    ASSERT_TRUE(server) << server.error().text;
    const std::string request = "GET /metrics HTTP/1.1\r\nHost: localhost\r\n\r\n";
    const std::string first = asked((*server)->address(), request);
    EXPECT_TRUE(first.starts_with("HTTP/1.1 500 ")) << first;
    EXPECT_NE(first.find("no figures now"), std::string::npos) << first;
    const std::string second = asked((*server)->address(), request);
    EXPECT_TRUE(second.starts_with("HTTP/1.1 200 ")) << second;
}

TEST(MetricsServer, SaysWhetherTheProgramIsWell) {
    std::string trouble;
    const auto text = [] { return std::string("a 1\n"); };
    const auto server = MetricsServer::start("0", false, text, [&] { return trouble; });
    const auto plain = MetricsServer::start("0", false, text);
    ASSERT_TRUE(server && plain);
    const auto health = [](MetricsServer& of) {
        return asked(of.address(), "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n");
    };
    for (MetricsServer* one : {server->get(), plain->get()}) {
        const std::string answer = health(*one);
        EXPECT_TRUE(answer.starts_with("HTTP/1.1 200 ") && answer.ends_with("\r\n\r\nok\n")) << answer;
    }
    trouble = "it hangs";
    const std::string answer = health(**server);
    EXPECT_TRUE(answer.starts_with("HTTP/1.1 503 ") && answer.ends_with("\r\n\r\nit hangs\n")) << answer;
    EXPECT_TRUE(fetchMetrics((*server)->address())) << "what it measures is there all the same";
}

// A foreign name may lead to loopback, and pages of other sites may send requests there.
TEST(MetricsServer, AnswersByItsOwnNamesAndNoPagesOfOthers) {
    int created = 0;
    const auto server = MetricsServer::start("0", false, [&] { return "a " + std::to_string(++created) + "\n"; });
    ASSERT_TRUE(server) << server.error().text;
    const auto status = [&](const std::string& fields) {
        const std::string answer = asked((*server)->address(), "GET /metrics HTTP/1.1\r\n" + fields + "\r\n");
        return answer.substr(9, 3);
    };
    for (const char* host : {"localhost", "localhost:9100", "127.0.0.1:1", "[::1]:80", "[::1]", " \t127.3.2.1 "})
        EXPECT_EQ(status("Host:" + std::string(host) + "\r\n"), "200") << host;
    for (const char* host : {"evil.example", "127.0.0.1.evil.example:9100", "10.0.0.1", "[::2]", "localhost.evil"})
        EXPECT_EQ(status("Host: " + std::string(host) + "\r\n"), "403") << host;
    for (const char* fields : {"", "Host:\r\n", "Host: a b\r\n", "Host: localhost\r\nHost: localhost\r\n",
                               "Host: localhost:x\r\n", "Host: [::1\r\n", "X-Host: localhost\r\n"})
        EXPECT_EQ(status(fields), "400") << fields;
    EXPECT_EQ(status("Host: localhost\r\nOrigin: http://localhost:3000\r\n"), "200");
    EXPECT_EQ(status("Host: localhost\r\nOrigin: https://evil.example\r\n"), "403");
    EXPECT_EQ(status("Host: localhost\r\nOrigin: null\r\n"), "403");
    EXPECT_EQ(created, 7);
}

TEST(MetricsServer, WhoAsksNothingKeepsNobodyFromIt) {
    const auto server = MetricsServer::start("0", false, [] { return std::string("a 1\n"); });
    ASSERT_TRUE(server);
    const auto endpoint = feeds::Endpoint::parse("tcp://" + (*server)->address());
    const auto at = feeds::findAddress(*endpoint);
    std::vector<Descriptor> silent;
    for (int i = 0; i < 200; ++i) {
        silent.emplace_back(::socket(AF_INET, SOCK_STREAM, 0));
        ASSERT_EQ(::connect(silent.back().get(), at->get(), at->length), 0);
    }
    EXPECT_TRUE(fetchMetrics((*server)->address()));
}

TEST(MetricsServer, PlacesThatMakeNoSenseAreErrors) {
    for (const char* endpoint : {"", "x", "tcp://127.0.0.1:1", "70000", "0.0.0.0:0"})
        EXPECT_FALSE(MetricsServer::start(endpoint, false, [] { return std::string(); })) << endpoint;
}

}  // namespace rtsg
