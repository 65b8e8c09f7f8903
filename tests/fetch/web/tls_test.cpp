// Certificates: who is believed over https. The server's certificate is made here, and lasts an hour.
#include <rtsg/fetch/web_fetcher.h>

#include <atomic>
#include <csignal>
#include <cstdio>
#include <memory>
#include <thread>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <openssl/ec.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "support/loopback_listener.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

using testing::HasSubstr;

struct Pair {
    std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)> key{EVP_EC_gen("P-256"), EVP_PKEY_free};
    std::unique_ptr<X509, decltype(&X509_free)> certificate{X509_new(), X509_free};

    /// Vouched for by itself, for `localhost`, until `seconds` from now.
    explicit Pair(long seconds) {
        X509* const own = certificate.get();
        X509_set_version(own, 2);
        ASN1_INTEGER_set(X509_get_serialNumber(own), 1);
        X509_gmtime_adj(X509_getm_notBefore(own), -7200);
        X509_gmtime_adj(X509_getm_notAfter(own), seconds);
        X509_set_pubkey(own, key.get());
        X509_NAME_add_entry_by_txt(X509_get_subject_name(own), "CN", MBSTRING_ASC,
                                   reinterpret_cast<const unsigned char*>("localhost"), -1, -1, 0);
        X509_set_issuer_name(own, X509_get_subject_name(own));
        for (const auto& [what, text] :
             {std::pair(NID_subject_alt_name, "DNS:localhost"), std::pair(NID_basic_constraints, "critical,CA:TRUE")}) {
            X509_EXTENSION* one = X509V3_EXT_conf_nid(nullptr, nullptr, what, text);
            X509_add_ext(own, one, -1);
            X509_EXTENSION_free(one);
        }
        EXPECT_GT(X509_sign(own, key.get(), EVP_sha256()), 0);
    }
};

/// Answers everything with one text.
class TlsServer {
  public:
    explicit TlsServer(const Pair& pair) : context_(SSL_CTX_new(TLS_server_method()), SSL_CTX_free) {
        SSL_CTX_use_certificate(context_.get(), pair.certificate.get());
        SSL_CTX_use_PrivateKey(context_.get(), pair.key.get());
        thread_ = std::thread([this] { serve(); });
    }
    ~TlsServer() {
        over_ = true;
        thread_.join();
    }
    TlsServer(const TlsServer&) = delete;
    TlsServer& operator=(const TlsServer&) = delete;

    std::string address(const std::string& host) const {
        return fmt::format("https://{}:{}/a", host, listener_.port());
    }
    int answered() const { return answered_; }

  private:
    void serve() {
        while (!over_) {
            pollfd waiting{listener_.get(), POLLIN, 0};
            if (::poll(&waiting, 1, 10) <= 0) continue;
            const int one = ::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC);
            if (one < 0) continue;
            SSL* const session = SSL_new(context_.get());
            SSL_set_fd(session, one);
            char block[4096];
            if (SSL_accept(session) == 1 && SSL_read(session, block, sizeof block) > 0) {
                ++answered_;
                constexpr std::string_view kAnswer = "HTTP/1.1 200 OK\r\nContent-Length: 6\r\n\r\nsecret";
                SSL_write(session, kAnswer.data(), kAnswer.size());
                SSL_shutdown(session);
            }
            SSL_free(session);
            ::close(one);
        }
    }

    std::unique_ptr<SSL_CTX, decltype(&SSL_CTX_free)> context_;
    test::LoopbackListener listener_{8};
    std::atomic<bool> over_ = false;
    std::atomic<int> answered_ = 0;
    std::thread thread_;
};

class Certificates : public testing::Test {
  protected:
    static void SetUpTestSuite() { std::signal(SIGPIPE, SIG_IGN); }  // a client that trusts nobody shuts the connection

    std::string read(const std::string& address, const std::filesystem::path& authorities) const {
        FetchSettings settings;
        settings.rules.allowed = {*WebAddress::parse(address)};
        settings.certificates = authorities;
        settings.totalSeconds = 20;
        WebFetcher fetcher(settings);
        auto content = fetcher.fetch(address, 1000);
        if (!content) return "refused: " + content.error().text;
        char block[100];
        const ssize_t got = ::read(content->descriptor, block, sizeof block);
        ::close(content->descriptor);
        return {block, static_cast<std::size_t>(std::max<ssize_t>(0, got))};
    }
    std::filesystem::path store(const Pair& pair, const std::string& name) const {
        const auto file = own.path() / name;
        if (FILE* out = std::fopen(file.c_str(), "w")) {
            PEM_write_X509(out, pair.certificate.get());
            std::fclose(out);
        }
        return file;
    }

    const test::TempFolder own;
};

TEST_F(Certificates, OnlyThoseThatAnAuthorityVouchesFor) {
    const Pair pair(3600), another(3600);
    const TlsServer server(pair);
    const std::string address = server.address("localhost");
    EXPECT_EQ(read(address, store(pair, "own.pem")), "secret");
    EXPECT_EQ(server.answered(), 1);
    EXPECT_THAT(read(address, {}), HasSubstr("its certificate is not trusted"));
    EXPECT_THAT(read(address, store(another, "another.pem")), HasSubstr("its certificate is not trusted"));
    EXPECT_EQ(server.answered(), 1) << "nothing was asked for";
}

TEST_F(Certificates, OnlyForTheHostThatIsAskedFor) {
    const Pair pair(3600);
    const TlsServer server(pair);
    EXPECT_THAT(read(server.address("127.0.0.1"), store(pair, "own.pem")), HasSubstr("refused: "));
    EXPECT_EQ(server.answered(), 0);
}

TEST_F(Certificates, OnlyWhileTheyLast) {
    const Pair pair(-3600);
    const TlsServer server(pair);
    EXPECT_THAT(read(server.address("localhost"), store(pair, "own.pem")), HasSubstr("its certificate is not trusted"));
    EXPECT_EQ(server.answered(), 0);
}

}  // namespace
}  // namespace rtsg
