// The gateway by TLS: pages and messages to who speaks it, nothing to who does not; certificates that are none. Spoken
// to by OpenSSL's own client.
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <openssl/ec.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>
#include <sys/socket.h>

#include <rtsg/sync/web_gateway.h>

#include "mirror_support.h"
#include "support/temp_folder.h"
#include "web_line.h"

namespace rtsg {
namespace {

using testing::EndsWith;
using testing::HasSubstr;
using testing::StartsWith;

/// A certificate that vouches for itself, and its key.
void makeCertificate(const std::filesystem::path& certificate, const std::filesystem::path& key) {
    EVP_PKEY* pair = EVP_EC_gen("P-256");
    X509* own = X509_new();
    X509_set_version(own, 2);
    ASN1_INTEGER_set(X509_get_serialNumber(own), 1);
    X509_gmtime_adj(X509_getm_notBefore(own), 0);
    X509_gmtime_adj(X509_getm_notAfter(own), 3600);
    X509_set_pubkey(own, pair);
    X509_NAME_add_entry_by_txt(X509_get_subject_name(own), "CN", MBSTRING_ASC,
                               reinterpret_cast<const unsigned char*>("localhost"), -1, -1, 0);
    X509_set_issuer_name(own, X509_get_subject_name(own));
    EXPECT_GT(X509_sign(own, pair, EVP_sha256()), 0);
    if (FILE* out = std::fopen(certificate.c_str(), "w")) PEM_write_X509(out, own), std::fclose(out);
    if (FILE* out = std::fopen(key.c_str(), "w"))
        PEM_write_PrivateKey(out, pair, nullptr, nullptr, 0, nullptr, nullptr), std::fclose(out);
    X509_free(own);
    EVP_PKEY_free(pair);
}

int connectTo(int port) {
    const int descriptor = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::connect(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
    return descriptor;
}

class TlsLine {
  public:
    explicit TlsLine(int port, int maximum = 0)
        : descriptor_(connectTo(port)), context_(SSL_CTX_new(TLS_client_method())) {
        SSL_CTX_set_security_level(context_, 0);  // what is refused, the other side refuses
        SSL_CTX_set_min_proto_version(context_, TLS1_VERSION);
        if (maximum) SSL_CTX_set_max_proto_version(context_, maximum);
        tls_ = SSL_new(context_);
        SSL_set_fd(tls_, descriptor_);
        agreed = SSL_connect(tls_) == 1;
    }
    ~TlsLine() {
        SSL_free(tls_);
        SSL_CTX_free(context_);
        ::close(descriptor_);
    }
    TlsLine(const TlsLine&) = delete;
    TlsLine& operator=(const TlsLine&) = delete;

    void say(std::string_view bytes) { EXPECT_GT(SSL_write(tls_, bytes.data(), static_cast<int>(bytes.size())), 0); }
    /// Until `enough`, or the end.
    bool hear(const std::function<bool()>& enough) {
        while (!enough()) {
            char buffer[4096];
            const int count = SSL_read(tls_, buffer, sizeof(buffer));
            if (count <= 0) return enough();
            heard.append(buffer, static_cast<std::size_t>(count));
        }
        return true;
    }
    bool agreed = false;
    std::string heard;

  private:
    int descriptor_;
    SSL_CTX* context_;
    SSL* tls_ = nullptr;
};

class WebTls : public testing::Test {
  protected:
    void SetUp() override {
        makeCertificate(folder / "own.pem", folder / "own.key");
        std::filesystem::create_directories(folder.path() / "page");
        std::ofstream(folder / "page/index.html") << "<p>" << std::string(100'000, 'x');
        server = *MirrorServer::start(scene, test::kAnyPort);
        options.folder = folder.path();
        options.certificate = folder / "own.pem";
        options.privateKey = folder / "own.key";
    }
    void start() {
        auto started = WebGateway::start(*server, options);
        ASSERT_TRUE(started) << started.error().text;
        gateway = std::move(*started);
        port = std::stoi(gateway->url().substr(gateway->url().rfind(':') + 1));
    }
    std::string problem() {
        auto started = WebGateway::start(*server, options);
        return started ? "" : started.error().text;
    }

    test::TempFolder folder;
    Scene scene;
    std::unique_ptr<MirrorServer> server;
    WebGatewayOptions options;
    std::unique_ptr<WebGateway> gateway;
    int port = 0;
};

TEST_F(WebTls, GivesPagesAndPassesMessages) {
    start();
    EXPECT_THAT(gateway->url(), StartsWith("https://127.0.0.1:"));
    TlsLine page(port);
    ASSERT_TRUE(page.agreed);
    for (int i = 0; i < 2; ++i) {  // one connection, two requests
        page.heard.clear();
        page.say("GET / HTTP/1.1\r\nHost: localhost\r\n\r\n");
        // To its last byte: what is left would be heard as the next answer.
        ASSERT_TRUE(page.hear([&] {
            const std::size_t head = page.heard.find("\r\n\r\n");
            return head != std::string::npos && page.heard.size() >= head + 4 + 100'003;
        }));
        EXPECT_THAT(page.heard, StartsWith("HTTP/1.1 200 OK\r\n"));
        EXPECT_THAT(page.heard, EndsWith("xxx"));
    }
    TlsLine line(port);
    ASSERT_TRUE(line.agreed);
    line.say(
        "GET /mirror HTTP/1.1\r\nHost: localhost\r\nOrigin: https://localhost\r\nUpgrade: websocket\r\nConnection: "
        "Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n");
    ASSERT_TRUE(line.hear([&] { return line.heard.find("\r\n\r\n") != std::string::npos; }));
    EXPECT_THAT(line.heard, StartsWith("HTTP/1.1 101 "));
    line.heard.erase(0, line.heard.find("\r\n\r\n") + 4);
    // A hello (PROTOCOL.md): a frame with a mask of zeros round the length of the first part and that.
    std::string hello("RTSG\x01\x01\0\0", 8);
    for (const std::uint64_t n :
         {std::uint64_t{5}, std::uint64_t{0}, std::uint64_t{0}, std::uint64_t{0}, std::uint64_t{1} << 20})
        hello.append(reinterpret_cast<const char*>(&n), 8);
    hello += std::string("\x03tls", 4);
    const auto size = static_cast<std::uint32_t>(hello.size());
    std::string message(reinterpret_cast<const char*>(&size), 4);
    message += hello;
    line.say(std::string("\x82") + static_cast<char>(0x80 | message.size()) + std::string(4, '\0') + message);
    ASSERT_TRUE(line.hear([&] { return line.heard.find("RTSGrec1") != std::string::npos; })) << "the welcome";
    EXPECT_TRUE(test::eventually([&] { return server->statistics().peers == 1; })) << "after the welcome is on its way";
    gateway.reset();
    EXPECT_FALSE(line.hear([] { return false; })) << "its end ends the connection";
}

TEST_F(WebTls, WhoSpeaksSomethingElseGetsNothing) {
    options.requestTimeout = std::chrono::milliseconds(300);
    start();
    const int clear = connectTo(port);
    const std::string request = "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n";
    EXPECT_EQ(::send(clear, request.data(), request.size(), MSG_NOSIGNAL), static_cast<ssize_t>(request.size()));
    std::string heard;
    char buffer[4096];
    for (ssize_t count = 1; count > 0;) {
        count = ::recv(clear, buffer, sizeof(buffer), 0);
        if (count > 0) heard.append(buffer, static_cast<std::size_t>(count));
    }
    EXPECT_EQ(heard.find("HTTP/1.1 200"), std::string::npos);
    ::close(clear);
    EXPECT_FALSE(TlsLine(port, TLS1_1_VERSION).agreed) << "older than 1.2";
    EXPECT_TRUE(TlsLine(port, TLS1_2_VERSION).agreed);
    const int silent = connectTo(port);
    EXPECT_EQ(::recv(silent, buffer, sizeof(buffer), 0), 0) << "who says nothing is let go";
    ::close(silent);
    EXPECT_TRUE(test::eventually([&] { return gateway->statistics().refused >= 3; }));
}

// A client that has not agreed on encryption yet counts as silent, too.
TEST_F(WebTls, TheSilentMakeWay) {
    start();
    std::vector<std::unique_ptr<test::Line>> silent;
    for (int i = 0; i < 300; ++i) silent.push_back(std::make_unique<test::Line>(port));
    for (int i = 0; i < 5; ++i) {
        TlsLine page(port);
        ASSERT_TRUE(page.agreed);
        page.say("GET / HTTP/1.1\r\nHost: localhost\r\n\r\n");
        ASSERT_TRUE(page.hear([&] { return page.heard.size() > 15; }));
        EXPECT_THAT(page.heard, StartsWith("HTTP/1.1 200 OK\r\n"));
    }
    EXPECT_TRUE(silent.front()->ended());
}

TEST_F(WebTls, CertificatesThatAreNoneAreNamed) {
    options.privateKey.clear();
    EXPECT_THAT(problem(), HasSubstr("needs a certificate and its private key"));
    options.privateKey = folder / "none.key";
    EXPECT_THAT(problem(), HasSubstr("no key for that certificate in '" + options.privateKey.string()));
    EXPECT_THAT(problem(), HasSubstr("No such file"));
    makeCertificate(folder / "other.pem", folder / "other.key");
    options.privateKey = folder / "other.key";
    EXPECT_THAT(problem(), HasSubstr("no key for that certificate")) << "of another pair";
    options.certificate = folder / "page/index.html";
    EXPECT_THAT(problem(), HasSubstr("no certificate in '"));
    options.certificate = folder / "none.pem";
    EXPECT_THAT(problem(), HasSubstr("none.pem': No such file"));
}

}  // namespace
}  // namespace rtsg
