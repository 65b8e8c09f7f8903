// Files that appear when they are complete: what was there before stays whole until then.
#include <rtsg/core/output_file.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>

#include <sys/stat.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/documents/document_handler.h>
#include <rtsg/documents/writer.h>

#include "support/temp_folder.h"

namespace rtsg {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class Writing : public testing::Test {
  protected:
    static std::string read(const fs::path& file) {
        std::ifstream in(file, std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }
    static void put(const fs::path& file, const std::string& text) { std::ofstream(file) << text; }
    std::size_t files() const {
        return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
    }

    const test::TempFolder own;
    const fs::path folder = own.path();
};

TEST_F(Writing, AFileAppearsWhenItIsComplete) {
    const fs::path file = folder / "a.txt";
    auto out = OutputFile::create(file);
    ASSERT_TRUE(out);
    ASSERT_TRUE(out->write("one "));
    EXPECT_FALSE(fs::exists(file));
    ASSERT_TRUE(out->write("two"));
    ASSERT_TRUE(out->commit());
    EXPECT_EQ(read(file), "one two");
    EXPECT_EQ(files(), 1u);
    EXPECT_FALSE(out->write("three")) << "it is closed";
}

TEST_F(Writing, WhatIsNotCommittedLeavesTheOldFileAndNothingElse) {
    const fs::path file = folder / "a.txt";
    put(file, "old");
    {
        auto out = OutputFile::create(file);
        ASSERT_TRUE(out);
        ASSERT_TRUE(out->write("new"));
        EXPECT_EQ(read(file), "old");
    }
    EXPECT_EQ(read(file), "old");
    EXPECT_EQ(files(), 1u);
}

TEST_F(Writing, AFileThatIsToBeKeptIsNotReplaced) {
    const fs::path file = folder / "a.txt";
    put(file, "old");
    const auto refused = OutputFile::create(file, Existing::keep);
    ASSERT_FALSE(refused);
    EXPECT_THAT(refused.error().format(), HasSubstr("a.txt: error: there is a file already"));
    // One that comes while the new one is written is kept as well.
    const fs::path other = folder / "b.txt";
    auto out = OutputFile::create(other, Existing::keep);
    ASSERT_TRUE(out);
    put(other, "another's");
    EXPECT_FALSE(out->commit());
    EXPECT_EQ(read(other), "another's");
}

TEST_F(Writing, ALinkStandsForWhatItLeadsTo) {
    fs::create_directory(folder / "there");
    const fs::path file = folder / "there/a.txt", link = folder / "link.txt", loose = folder / "loose.txt";
    put(file, "old");
    fs::create_symlink("there/a.txt", link);
    fs::create_symlink("there/b.txt", loose);
    ASSERT_TRUE(writeWholeFile(link, std::as_bytes(std::span("new", 3))));
    ASSERT_TRUE(writeWholeFile(loose, std::as_bytes(std::span("new", 3))));
    EXPECT_TRUE(fs::is_symlink(link));
    EXPECT_TRUE(fs::is_symlink(loose));
    EXPECT_EQ(read(file), "new");
    EXPECT_EQ(read(folder / "there/b.txt"), "new");
    const fs::path second = folder / "second.txt";
    fs::create_symlink("link.txt", second);
    ASSERT_TRUE(writeWholeFile(second, std::as_bytes(std::span("two", 3))));
    EXPECT_TRUE(fs::is_symlink(second) && fs::is_symlink(link)) << "neither link of a chain is replaced";
    EXPECT_EQ(read(file), "two");
}

TEST_F(Writing, PermissionsStay) {
    const fs::path file = folder / "a.txt";
    put(file, "old");
    ASSERT_EQ(::chmod(file.c_str(), 0640), 0);
    ASSERT_TRUE(writeWholeFile(file, {}));
    struct stat status{};
    ASSERT_EQ(::stat(file.c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777, 0640u);
    const mode_t mask = ::umask(027);
    ASSERT_TRUE(writeWholeFile(folder / "b.txt", {}));
    ::umask(mask);
    ASSERT_EQ(::stat((folder / "b.txt").c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777, 0640u);
}

TEST_F(Writing, ErrorsSayWhatAndWhere) {
    const auto nowhere = OutputFile::create(folder / "no/such/a.txt");
    ASSERT_FALSE(nowhere);
    EXPECT_THAT(nowhere.error().format(),
                HasSubstr("no/such/a.txt: error: cannot write: " + std::string(strerror(ENOENT))));
    EXPECT_FALSE(OutputFile::create(folder));
    // A device is written as it comes; a full one says so, and commit() says it again.
    auto full = OutputFile::create("/dev/full");
    ASSERT_TRUE(full);
    EXPECT_FALSE(full->write("x"));
    EXPECT_FALSE(full->commit());
    EXPECT_TRUE(fs::is_character_file("/dev/full"));
}

TEST_F(Writing, NamesOfOneFileAreFound) {
    const fs::path file = folder / "a.txt";
    put(file, "x");
    put(folder / "b.txt", "x");
    fs::create_symlink(file, folder / "link");
    fs::create_hard_link(file, folder / "hard");
    EXPECT_TRUE(sameFile(file, folder / "link"));
    EXPECT_TRUE(sameFile(folder / "hard", folder / "link"));
    EXPECT_TRUE(sameFile(file, folder / "../" / folder.filename() / "a.txt"));
    EXPECT_FALSE(sameFile(file, folder / "b.txt"));
    EXPECT_FALSE(sameFile(file, folder / "none"));
    EXPECT_TRUE(sameFile(folder / "none", folder / "./none")) << "neither is there yet";
    EXPECT_FALSE(sameFile(folder / "none", folder / "nothing"));
    EXPECT_TRUE(sameFile("no-such-file.wav", "./no-such-file.wav")) << "below the folder that one is in";
    EXPECT_TRUE(sameFile("no-such-file.wav", fs::current_path() / "no-such-file.wav"));
    EXPECT_FALSE(sameFile("no-such-file.wav", "./another.wav"));
}

TEST_F(Writing, NamesBesideFitAndKeepTheirExtension) {
    const fs::path fresh = freshNameBeside(folder / (std::string(240, 'a') + ".png"));
    EXPECT_EQ(fresh.parent_path(), folder);
    EXPECT_EQ(fresh.extension(), ".png");
    EXPECT_LE(fresh.filename().string().size(), 255u);
    EXPECT_TRUE(writeWholeFile(folder / (std::string(240, 'a') + ".png"), {}));
}

TEST_F(Writing, ADocumentWithoutCloseLeavesTheOldOne) {
    for (const char* name : {"a.x3dv", "a.x3dv.gz"}) {
        const fs::path file = folder / name;
        put(file, "old");
        Diagnostics diagnostics;
        {
            auto writer = DocumentFileWriter::create(file, diagnostics);
            ASSERT_TRUE(writer) << name;
        }
        EXPECT_EQ(read(file), "old") << name;
        EXPECT_FALSE(DocumentFileWriter::create(file, diagnostics, Existing::keep)) << name;
        auto writer = DocumentFileWriter::create(file, diagnostics);
        ASSERT_TRUE(writer) << name;
        EXPECT_TRUE((*writer)->close()) << name;
        EXPECT_NE(read(file), "old") << name;
    }
    EXPECT_EQ(files(), 2u);
}

}  // namespace
}  // namespace rtsg
