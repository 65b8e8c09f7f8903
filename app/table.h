// rtsg replay --table: fields of a log over time, as CSV.
#pragma once

#include <string>

#include <rtsg/sync/log_table.h>

namespace rtsg::app {

struct TableArguments {
    std::string log, fields, out;  // fields by commas; "-" or nothing: to standard output
    TableOptions options;
    bool json = false;
};

/// The exit status.
int writeTable(const TableArguments& arguments);

}  // namespace rtsg::app
