// What sessions of the program say goes to standard error, and signals end them.
#include "cli.h"
#include "extensions.h"
#include "say.h"

namespace rtsg::app {

namespace {

class ProgramNotices final : public Notices {
  public:
    void report(const Diagnostic& diagnostic) override {
        diagnostic.severity == Severity::error ? printError(diagnostic) : say(diagnostic);
    }
    void report(const Diagnostics& diagnostics, std::string_view known) override { print(diagnostics, known); }
    void note(std::string_view text) override { say(text); }
    Progress progress(const std::string& work) override { return progressBar(work); }
    bool interrupted() const override { return app::interrupted(); }
    void leftOut() override { noteLeftOut(); }
    void damaged(const std::string& file, std::size_t errors) override { noteDamage(file, errors); }
};

}  // namespace

const SessionContext& programContext() {
    static ProgramNotices notices;
    static const SessionContext context{&notices, &extensions()};
    return context;
}

}  // namespace rtsg::app
