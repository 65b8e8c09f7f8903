// rtsg replay --table: fields of a log over time, as CSV.
#pragma once

#include <string>
#include <vector>

#include <rtsg/sync/log_table.h>

namespace rtsg::app {

struct TableArguments {
    std::string log, fields, out;  // fields by commas; "-" or nothing: to standard output
    TableOptions options;
    bool json = false;
};

/// "A.x,B.*" one by one; of an empty text none.
std::vector<std::string> splitFields(const std::string& text);

/// Throws UsageError for a kind of table that is not written here.
void checkTableName(const std::string& out);
/// The exit status.
int writeTable(const TableArguments& arguments);

}  // namespace rtsg::app
