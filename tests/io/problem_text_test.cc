#include "oriel/io/problem_text.h"

#include <bzlib.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <cstdio>
#include <string>

#include "oriel/io/g2o.h"
#include "oriel/io/text.h"

namespace oriel {
namespace {

std::string gzip(const std::string& text) {
  std::string out(text.size() + 1000, '\0');
  z_stream z{};
  EXPECT_EQ(deflateInit2(&z, 6, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY), Z_OK);
  z.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  z.avail_in = static_cast<unsigned>(text.size());
  z.next_out = reinterpret_cast<Bytef*>(out.data());
  z.avail_out = static_cast<unsigned>(out.size());
  EXPECT_EQ(deflate(&z, Z_FINISH), Z_STREAM_END);
  out.resize(out.size() - z.avail_out);
  deflateEnd(&z);
  return out;
}

std::string bzip2(std::string text) {
  std::string out(text.size() + 10000, '\0');
  auto size = static_cast<unsigned>(out.size());
  EXPECT_EQ(BZ2_bzBuffToBuffCompress(out.data(), &size, text.data(), static_cast<unsigned>(text.size()), 9, 0, 0),
            BZ_OK);
  out.resize(size);
  return out;
}

Result<ProblemText> unpack_string(const std::string& bytes) {
  ProblemText text;
  bytes.copy(text.grow(bytes.size()), bytes.size());
  text.advance(bytes.size());
  return unpack(std::move(text), "f.gz");
}

std::string large_text() {
  std::string text;
  for (int i = 0; i < 50000; ++i) text += "EDGE_SE2 " + std::to_string(i) + " 0 1 2 3\n";
  return text;
}

TEST(ProblemText, IsTheSamePlainAndPackedBySeveralStreams) {
  const std::string text = large_text();
  for (const std::string& packed : {text, gzip(text), bzip2(text)}) {
    const auto out = unpack_string(packed);
    ASSERT_TRUE(out) << out.error();
    EXPECT_EQ(out->view(), text);
  }
  const auto twice = unpack_string(gzip("one\n") + gzip("two\n"));
  ASSERT_TRUE(twice) << twice.error();
  EXPECT_EQ(twice->view(), "one\ntwo\n");
  const auto both = unpack_string(bzip2("one\n") + bzip2("two\n"));
  ASSERT_TRUE(both) << both.error();
  EXPECT_EQ(both->view(), "one\ntwo\n");
  EXPECT_EQ(unpack_string("")->view(), "");
}

TEST(ProblemText, NamesTheFileWherePackedDataAreDamagedCutOrFollowedByJunk) {
  const std::string text = large_text();
  const auto error = [](const std::string& bytes) {
    const auto out = unpack_string(bytes);
    return out ? "no error" : out.error().text();
  };
  const std::string gz = gzip(text), bz = bzip2(text);
  EXPECT_EQ(error(gz.substr(0, gz.size() / 2)), "f.gz: expected gzip data, found an end too early");
  EXPECT_EQ(error(bz.substr(0, bz.size() / 2)), "f.gz: expected bzip2 data, found an end too early");
  EXPECT_EQ(error(gz.substr(0, 2)), "f.gz: expected gzip data, found an end too early");
  EXPECT_EQ(error(gz + "junk"), "f.gz: expected gzip data, found damage");
  EXPECT_EQ(error(bz + "junk"), "f.gz: expected bzip2 data, found damage");
  std::string bad = gz;
  bad[bad.size() - 6] ^= 1;  // the check sum
  EXPECT_EQ(error(bad), "f.gz: expected gzip data, found damage");
  bad = bz;
  bad[bad.size() / 2] ^= 1;
  EXPECT_EQ(error(bad), "f.gz: expected bzip2 data, found damage");
}

TEST(ProblemText, OfAFileIsToldByItsBytesAndNotByItsName) {
  const std::string path = testing::TempDir() + "packed.g2o";
  ASSERT_TRUE(write_text_file(path, gzip("EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\nEDGE_SE2 1 2 x\n")));
  const auto graph = read_g2o(path);
  ASSERT_FALSE(graph);
  EXPECT_EQ(graph.error().text(), path + ":2: EDGE_SE2: expected a finite number for x, found 'x'");
  std::remove(path.c_str());
  EXPECT_EQ(read_problem_text(path).error().code, ErrorCode::not_found);
  EXPECT_EQ(read_problem_text(testing::TempDir()).error().message, "expected a file, found a directory");
}

}  // namespace
}  // namespace oriel
