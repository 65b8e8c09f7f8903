// Accounts and certificates of brokers come by the environment, and what is secret in them is said nowhere: not in
// messages, reports, metrics, logs or the list of processes.
#include <arpa/inet.h>
#include <sys/socket.h>

#include <cstdlib>
#include <initializer_list>
#include <map>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "mirror_session.h"
#include "support/mosquitto.h"

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

constexpr const char* kSecret = "sesame-7";

/// Variables of the environment until the end of a test.
class Environment {
  public:
    Environment(std::initializer_list<std::pair<const std::string, std::string>> variables) : variables_(variables) {
        for (const auto& [name, value] : variables_) ::setenv(name.c_str(), value.c_str(), 1);
    }
    ~Environment() {
        for (const auto& [name, value] : variables_) ::unsetenv(name.c_str());
    }
    Environment(const Environment&) = delete;
    Environment& operator=(const Environment&) = delete;

  private:
    std::map<std::string, std::string> variables_;
};

class Secrets : public Mirror {
  protected:
    /// An authority, and a certificate that it gave to 127.0.0.1 and one for a client; false without openssl.
    bool certify() const {
        const std::string to = folder / "", quiet = " > /dev/null 2>&1";
        const auto make = [&](const std::string& name, const std::string& subject, const std::string& more) {
            return "openssl req -newkey rsa:2048 -nodes -keyout " + to + name + ".key -subj /CN=" + subject + more +
                   quiet;
        };
        std::string all = make("ca", "Tests", " -x509 -days 2 -out " + to + "ca.pem");
        for (const std::string name : {"server", "client"}) {
            writeFile(folder / (name + ".ext"), "subjectAltName=IP:127.0.0.1,DNS:localhost\n");
            all += " && " + make(name, name, " -out " + to + name + ".csr") + " && openssl x509 -req -days 2 -in " +
                   to + name + ".csr -CA " + to + "ca.pem -CAkey " + to + "ca.key -CAcreateserial -extfile " + to +
                   name + ".ext -out " + to + name + ".pem" + quiet;
        }
        return std::system(all.c_str()) == 0;
    }
    /// All that a running program shows to others.
    std::string shownBy(const Program& program, const json& begun) const {
        std::string all = program.said();
        const std::string address = begun.at("metrics");
        const int to = NatsServer::connected(std::stoi(address.substr(address.rfind(':') + 1)), false);
        const std::string ask = "GET /metrics HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n";
        (void)!::send(to, ask.data(), ask.size(), 0);
        char bytes[4096];
        for (ssize_t count = 0; (count = ::recv(to, bytes, sizeof(bytes), 0)) > 0;)
            all.append(bytes, static_cast<std::size_t>(count));
        ::close(to);
        for (const auto& process : std::filesystem::directory_iterator("/proc"))
            if (const std::string line = readFile(process.path() / "cmdline"); line.contains(file)) all += line;
        return all + begun.dump();
    }
    void followByNats(const std::string& address) {
        Program server(
            {"serve", file, "--nats", address, "--json", "--metrics-port", "0", "--record", folder / "session.rlog"},
            streams());
        const json begun = json::parse(server.firstLine());
        const Outcome mirror = rtsg({"mirror", address, "--for", "1s", "--json"});
        EXPECT_EQ(mirror.status, 0) << mirror.err;
        EXPECT_THAT(shownBy(server, begun), Not(HasSubstr(kSecret)));
        server.signal(SIGINT);
        const Outcome served = server.wait();
        EXPECT_EQ(served.status, 0) << served.err;
        for (const std::string& text :
             {mirror.out, mirror.err, served.out, served.err, readFile(folder / "session.rlog")})
            EXPECT_THAT(text, Not(HasSubstr(kSecret)));
    }
    /// A line of one program reaches another by the broker.
    void passByMqtt(const std::string& endpoint) {
        Program reader(
            {"serve", file, "--bind", "tcp://127.0.0.1:*", "--json", "--feed", endpoint, "--metrics-port", "0"},
            streams());
        const json begun = json::parse(reader.firstLine());
        const Outcome writer = rtsg(
            {"run", file, "--for", "1s", "--realtime", "--publish", endpoint, "--fields", "BOX.translation", "--json"});
        EXPECT_EQ(writer.status, 0) << writer.err;
        EXPECT_THAT(shownBy(reader, begun), Not(HasSubstr(kSecret)));
        reader.signal(SIGINT);
        const Outcome read = reader.wait();
        EXPECT_EQ(read.status, 0) << read.err;
        if (read.out.empty()) return;
        EXPECT_GT(json::parse(lastLine(read.out)).at("feeds").at(0).at("events"), 0);
        for (const std::string& text : {writer.out, writer.err, read.out, read.err})
            EXPECT_THAT(text, Not(HasSubstr(kSecret)));
    }
    bool lacksNats() {
        if (NatsServer::program().empty()) return true;
        return rtsg({"mirror", "nats://127.0.0.1:1/none", "--wait", "0.1s"}).err.find("leaves it out") !=
               std::string::npos;
    }
    bool lacksMqtt() {
        if (Mosquitto::program().empty()) return true;
        return rtsg({"run", file, "--for", "0s", "--feed", "mqtt://127.0.0.1:1/a"}).err.find("leaves MQTT out") !=
               std::string::npos;
    }
};

TEST_F(Secrets, ANatsAccountComesByTheEnvironment) {
    if (lacksNats()) GTEST_SKIP() << NatsServer::kMissing;
    NatsServer nats(std::string("authorization { user: anna, password: ") + kSecret + " }");
    const Outcome without = rtsg({"mirror", nats.address(), "--for", "1s"});
    EXPECT_EQ(without.status, 1);
    EXPECT_THAT(without.err, HasSubstr("uthorization"));
    const Environment account{{"NATS_USER", "anna"}, {"NATS_PASSWORD", kSecret}};
    followByNats(nats.address());
    const Outcome wrong = rtsg({"mirror", nats.address("hall", std::string("anna:") + kSecret + "x@"), "--for", "1s"});
    EXPECT_EQ(wrong.status, 1) << "what the address says comes first";
    EXPECT_THAT(wrong.err, Not(HasSubstr(kSecret)));
}

TEST_F(Secrets, ANatsTokenComesByTheEnvironment) {
    if (lacksNats()) GTEST_SKIP() << NatsServer::kMissing;
    NatsServer nats(std::string("authorization { token: ") + kSecret + " }");
    const Environment token{{"NATS_USER", kSecret}};
    followByNats(nats.address());
}

TEST_F(Secrets, NatsIsEncryptedWithCertificatesOfBothSides) {
    if (lacksNats()) GTEST_SKIP() << NatsServer::kMissing;
    if (!certify()) GTEST_SKIP() << "openssl is not installed";
    const auto at = [&](const char* name) { return std::string(folder / name); };
    NatsServer nats("tls { cert_file: \"" + at("server.pem") + "\", key_file: \"" + at("server.key") +
                    "\", ca_file: \"" + at("ca.pem") + "\", verify: true }");
    std::string address = nats.address();
    address.replace(0, 4, "tls");
    const Outcome strange = rtsg({"mirror", address, "--for", "1s"});
    EXPECT_EQ(strange.status, 1) << "the authority is nobody's whom this machine trusts";
    EXPECT_THAT(strange.err, HasSubstr("no connection to the NATS server"));
    const Environment files{{"NATS_CA", at("ca.pem")}, {"NATS_CERT", at("client.pem")}, {"NATS_KEY", at("client.key")}};
    followByNats(address);
}

TEST_F(Secrets, AnMqttAccountComesByTheEnvironment) {
    if (lacksMqtt()) GTEST_SKIP() << Mosquitto::kMissing;
    const std::string passwords = folder / "passwords";
    const std::string command = "mosquitto_passwd -c -b " + passwords + " anna " + kSecret + " > /dev/null 2>&1";
    if (std::system(command.c_str()) != 0) GTEST_SKIP() << "mosquitto_passwd is not installed";
    const Mosquitto broker("allow_anonymous false\npassword_file " + passwords + "\n");
    const Outcome without =
        rtsg({"serve", file, "--bind", "tcp://127.0.0.1:*", "--for", "1s", "--feed", broker.endpoint("scene")});
    EXPECT_EQ(without.status, 1);
    EXPECT_THAT(without.err, HasSubstr("the broker refuses"));
    const Environment account{{"MQTT_USER", "anna"}, {"MQTT_PASSWORD", kSecret}};
    passByMqtt(broker.endpoint("scene"));
}

TEST_F(Secrets, MqttIsEncryptedWithCertificatesOfBothSides) {
    if (lacksMqtt()) GTEST_SKIP() << Mosquitto::kMissing;
    if (!certify()) GTEST_SKIP() << "openssl is not installed";
    const auto at = [&](const char* name) { return std::string(folder / name); };
    const Mosquitto broker("allow_anonymous true\ncafile " + at("ca.pem") + "\ncertfile " + at("server.pem") +
                           "\nkeyfile " + at("server.key") + "\nrequire_certificate true\n");
    std::string endpoint = broker.endpoint("scene");
    endpoint.replace(0, 4, "mqtts");
    const Outcome strange = rtsg({"serve", file, "--bind", "tcp://127.0.0.1:*", "--for", "1s", "--feed", endpoint});
    EXPECT_EQ(strange.status, 1) << "the authority is nobody's whom this machine trusts";
    const Environment files{{"MQTT_CA", at("ca.pem")}, {"MQTT_CERT", at("client.pem")}, {"MQTT_KEY", at("client.key")}};
    passByMqtt(endpoint);
}

}  // namespace
}  // namespace rtsg::test
