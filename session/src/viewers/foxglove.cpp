// Joins what is told of a scene with the server for live viewers.
#include <rtsg/session/foxglove.h>

#include <algorithm>

namespace rtsg {

namespace {

class Viewers final : public MessageSink {
  public:
    explicit Viewers(FoxgloveServer& server) : server_(server) {}
    Result<std::uint16_t> addTopic(std::string_view topic, std::string_view schemaName, std::string_view schema,
                                   bool isState) override {
        return server_.addTopic(topic, schemaName, schema, isState);
    }
    bool wants(std::uint16_t topic) override { return server_.wants(topic); }
    bool wantsWhole(std::uint16_t topic) override { return server_.wantsWhole(topic); }
    Result<> write(std::uint16_t topic, double time, std::string json, Reach reach) override {
        using To = FoxgloveServer::Reach;
        server_.send(topic, time, std::move(json),
                     reach == Reach::change        ? To::change
                     : reach == Reach::wholeForAll ? To::wholeForAll
                                                   : To::wholeForNew);
        return {};
    }

  private:
    FoxgloveServer& server_;
};

}  // namespace

std::vector<std::string> fieldsIn(const std::vector<std::string>& texts) {
    std::vector<std::string> parts;
    for (const std::string& text : texts)
        for (std::size_t from = 0; from <= text.size();) {
            const std::size_t comma = std::min(text.find(',', from), text.size());
            if (comma > from) parts.push_back(text.substr(from, comma - from));
            from = comma + 1;
        }
    return parts;
}

Result<Foxglove> Foxglove::start(const std::string& listen, const std::vector<std::string>& fields,
                                 WorldOnDemand& world, const Settings& settings, const SessionContext& context) {
    Foxglove foxglove;
    foxglove.context_ = context;
    if (listen.empty()) return foxglove;
    FoxgloveOptions options;
    options.listen = listen;
    options.insecure = settings.insecure;
    options.call = settings.call;
    const auto failed = [](const Diagnostic& why) { return fail(why.code, "--foxglove " + why.text); };
    auto server = FoxgloveServer::start(std::move(options));
    if (!server) return failed(server.error());
    foxglove.server_ = std::move(*server);
    foxglove.sink_ = std::make_unique<Viewers>(*foxglove.server_);
    auto messages = SceneMessages::attach(world.get(), *foxglove.sink_, fieldsIn(fields));
    if (!messages) return failed(messages.error());
    foxglove.messages_ = std::move(*messages);
    context.note("live for viewers at " + foxglove.address());
    return foxglove;
}

void Foxglove::before() {
    if (server_) server_->service();
}

void Foxglove::after() {
    if (!server_) return;
    server_->service();
    (void)messages_->offer();  // a server takes everything
    if (const double now = messages_->time(); now != reported_) server_->sendTime(reported_ = now);
    for (const Diagnostic& d : server_->takeDiagnostics()) context_.report(d);
}

Result<> Foxglove::end() {
    if (!server_) return {};
    const std::string failure = messages_->failure();
    messages_.reset();
    server_.reset();
    if (failure.empty()) return {};
    return fail("--foxglove: " + failure);
}

}  // namespace rtsg
