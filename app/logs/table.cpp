// Writes fields of a log as CSV, a row for each state.
#include "table.h"

#include <cstdio>
#include <filesystem>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/output_file.h>

#include "cli.h"

namespace rtsg::app {

std::vector<std::string> splitFields(const std::string& text) {
    std::vector<std::string> fields;
    for (std::size_t from = 0; !text.empty() && from <= text.size();) {
        const std::size_t comma = std::min(text.find(',', from), text.size());
        fields.push_back(text.substr(from, comma - from));
        from = comma + 1;
    }
    return fields;
}

namespace {

Result<> writeTo(const std::string& out, const LogTable& table) {
    if (out.empty() || out == "-") {
        bool whole = true;
        table.writeCsv([&](std::string_view text) {
            whole = whole && std::fwrite(text.data(), 1, text.size(), stdout) == text.size();
        });
        if (!whole || std::fflush(stdout) != 0) return fail("standard output cannot be written");
        return {};
    }
    auto file = OutputFile::create(out);
    if (!file) return std::unexpected(file.error());
    Result<> written;
    table.writeCsv([&](std::string_view text) {
        if (written) written = file->write(text);
    });
    return written ? file->commit() : written;
}

}  // namespace

void checkTableName(const std::string& out) {
    if (std::filesystem::path(out).extension() == ".parquet")
        throw UsageError("-o", out +
                                   ": writing Parquet takes Apache Arrow, which Debian does not have; write .csv, or "
                                   "use Python: rtsg.Log(...).table(...).frame().to_parquet(...)");
}

int writeTable(const TableArguments& arguments) {
    const Progress bar = progressBar("reading " + arguments.log);
    TableOptions options = arguments.options;
    options.progress = [&](std::uint64_t done, std::uint64_t total) {
        if (bar) bar(done, total);
        return !interrupted();
    };
    std::optional<Divergence> lacks;
    const auto table = readTable(arguments.log, splitFields(arguments.fields), options, &lacks);
    if (bar) bar(1, 1);
    if (interrupted()) return printError("interrupted: no table was written"), kBad;
    if (!table) return printError(table.error()), kBad;
    if (auto ok = writeTo(arguments.out, *table); !ok) return printError(ok.error()), kBad;
    if (arguments.json)
        fmt::print("{{\"rows\":{},\"columns\":{},\"complete\":{}}}\n", table->times().size(), table->columns().size(),
                   !lacks);
    if (!lacks) return kDone;
    printError(fmt::format("{}: this is not all of it: {}", arguments.log, lacks->format()));
    return kBad;
}

}  // namespace rtsg::app
