// A terminal obeys control characters, and XML and JSON take UTF-8 only.
#include "base/printable.h"

#include <gtest/gtest.h>

namespace hapticd::base {
namespace {

const std::string kOther = "\xef\xbf\xbd";

TEST(Printable, KeepsCharacters) {
  EXPECT_EQ(printable(""), "");
  EXPECT_EQ(printable("Böhm's \xc2\xb5m, \xe2\x82\xac, \xf0\x9f\x98\x80"),
            "Böhm's \xc2\xb5m, \xe2\x82\xac, \xf0\x9f\x98\x80");
  EXPECT_EQ(printable("\xc2\xa0"), "\xc2\xa0") << "the first after the control characters";
}

TEST(Printable, ReplacesControlCharacters) {
  EXPECT_EQ(printable("a\x1b[2J\r\nb\x7f"), "a" + kOther + "[2J" + kOther + kOther + "b" + kOther);
  EXPECT_EQ(printable(std::string_view("\0", 1)), kOther);
  EXPECT_EQ(printable("1\xc2\x9b"
                      "2"),
            "1" + kOther + "2")
      << "U+009B begins an escape sequence, too";
}

TEST(Printable, ReplacesWhatIsNoCharacter) {
  EXPECT_EQ(printable("\xff"
                      "a"),
            kOther + "a");
  EXPECT_EQ(printable("\xc2"), kOther) << "cut off";
  EXPECT_EQ(printable("\xc0\xaf"), kOther + kOther) << "overlong";
  EXPECT_EQ(printable("\xe2\x82"), kOther + kOther) << "cut off";
  EXPECT_EQ(printable("\xed\xa0\x80"), kOther + kOther + kOther) << "a surrogate";
  EXPECT_EQ(printable("\xf4\x90\x80\x80").size(), 4 * kOther.size()) << "beyond Unicode";
  EXPECT_EQ(printable("\xef\xbf\xbe"), kOther + kOther + kOther) << "U+FFFE is not in XML";
}

TEST(Utf8, KeepsControlCharactersAndReplacesWhatIsNoCharacter) {
  EXPECT_EQ(utf8("a\n\xc2\xb5\xff"), "a\n\xc2\xb5" + kOther);
}

TEST(Beginning, CutsBetweenCharacters) {
  EXPECT_EQ(beginning("abc", 3), "abc");
  EXPECT_EQ(beginning("abc", 2), "ab");
  EXPECT_EQ(beginning("a\xc2\xb5", 2), "a");
  EXPECT_EQ(beginning("a\xf0\x9f\x98\x80z", 4), "a");
  EXPECT_EQ(beginning("\x80\x80\x80", 2), "") << "no character at all";
}

}  // namespace
}  // namespace hapticd::base
