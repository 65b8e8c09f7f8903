// Writes the messages of a scene into an MCAP file.
#include <rtsg/session/mcap_export.h>

namespace rtsg {

class McapExport::Sink final : public MessageSink {
  public:
    explicit Sink(McapWriter& writer) : writer_(writer) {}
    Result<std::uint16_t> addTopic(std::string_view topic, std::string_view schemaName, std::string_view schema,
                                   bool) override {
        return writer_.addTopic(topic, schemaName, schema);
    }
    bool wants(std::uint16_t) override { return true; }
    bool wantsWhole(std::uint16_t) override { return false; }
    Result<> write(std::uint16_t topic, double time, std::string json, Reach) override {
        return writer_.write(topic, time, json);
    }

  private:
    McapWriter& writer_;
};

Result<std::unique_ptr<McapExport>> McapExport::attach(SharedWorld& world, const std::string& file,
                                                       McapOptions options) {
    auto writer = McapWriter::create(file, options);
    if (!writer) return std::unexpected(writer.error());
    std::unique_ptr<McapExport> created(new McapExport);
    created->writer_ = std::move(*writer);
    created->sink_ = std::make_unique<Sink>(*created->writer_);
    auto messages = SceneMessages::attach(world, *created->sink_);
    if (!messages) return std::unexpected(messages.error());
    created->messages_ = std::move(*messages);
    return created;
}

Result<> McapExport::finish() {
    if (!failure().empty()) return fail(failure());
    messages_->detach();
    return writer_->close();
}

}  // namespace rtsg
