// Tokens and user ids against roles.
#include "server/session/credentials.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

namespace hapticd::server {
namespace {

namespace fs = std::filesystem;

constexpr const char* kOwner = "0123456789abcdef-owner";
constexpr const char* kOperator = "0123456789abcdef-operator";
constexpr std::uint32_t kUser = 4000;
constexpr std::uint32_t kLab = 0x0a010203;  // 10.1.2.3
constexpr base::Nanos kSecond = 1'000'000'000;

class CredentialsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    write("# roles\nowner " + std::string(kOwner) + "\n\noperator " + kOperator +
          "  # the panel\nobserver 0123456789abcdef-observer\n");
    config_.tokens = file_;
  }
  void TearDown() override { fs::remove(file_); }
  void write(const std::string& text, fs::perms mode = fs::perms::owner_read | fs::perms::owner_write) {
    std::ofstream(file_) << text;
    fs::permissions(file_, mode);
  }
  std::string errorOf() {
    try {
      Credentials(config_, kUser);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "";
  }

  const std::string file_ = fs::path(::testing::TempDir()) / ("tokens-" + std::to_string(getpid()));
  ServerConfig config_;
  std::string error_;
};

TEST_F(CredentialsTest, EveryClientIsOwnerWithoutTokens) {
  const Credentials none({}, kUser);
  EXPECT_EQ(none.identityOf(0x7f000001, {}).role, ClientRole::owner);
  EXPECT_FALSE(none.identityOf(0x7f000001, {}).proven);
  EXPECT_EQ(none.identityOf(0x7f000001, 5000).role, ClientRole::owner);
  EXPECT_FALSE(none.identityOf(0x7f000001, 5000).proven);
  EXPECT_FALSE(none.hasOperators());
  for (const std::uint32_t user : {0U, kUser}) EXPECT_TRUE(none.identityOf(0x7f000001, user).proven);
}

TEST_F(CredentialsTest, ATokenGivesItsRoleAndTheOthersObserve) {
  Credentials some(config_, kUser);
  EXPECT_EQ(some.identityOf(0x7f000001, {}).role, ClientRole::observer);
  EXPECT_TRUE(some.hasOperators());
  EXPECT_EQ(some.check(kOwner, "a", 0, error_)->role, ClientRole::owner);
  EXPECT_EQ(some.check(kOperator, "a", 0, error_)->role, ClientRole::operating);
  EXPECT_TRUE(some.check(kOperator, "a", 0, error_)->proven);
  EXPECT_EQ(some.check("0123456789abcdef-observer", "a", 0, error_)->role, ClientRole::observer);
  for (const std::string wrong :
       {"0123456789abcdef-owneR", "0123456789abcdef-owner1", "", "0123456789abcdef"})
    EXPECT_FALSE(some.check(wrong, wrong, 0, error_)) << wrong;
}

// Cut there it would be a weaker one.
TEST_F(CredentialsTest, ATokenMayHaveAHash) {
  write("owner 0123456789abcdef#more\noperator #123456789abcdef #the panel\n");
  Credentials some(config_, kUser);
  EXPECT_FALSE(some.check("0123456789abcdef", "a", 0, error_));
  const auto owner = some.check("0123456789abcdef#more", "a", 0, error_);
  ASSERT_TRUE(owner);
  EXPECT_EQ(owner->role, ClientRole::owner);
  EXPECT_TRUE(some.check("#123456789abcdef", "a", 0, error_));
}

TEST_F(CredentialsTest, TenWrongTokensAMinuteBlockTheirAddressAlone) {
  Credentials some(config_, kUser);
  for (int i = 0; i < 10; ++i) EXPECT_FALSE(some.check("0123456789abcdef", "10.0.0.1", i * kSecond, error_));
  EXPECT_EQ(error_, "wrong token");
  EXPECT_FALSE(some.check(kOwner, "10.0.0.1", 11 * kSecond, error_)) << "also the right one";
  EXPECT_NE(error_.find("try again in a minute"), std::string::npos);
  EXPECT_TRUE(some.check(kOwner, "10.0.0.2", 11 * kSecond, error_));
  EXPECT_TRUE(some.check(kOwner, "10.0.0.1", 61 * kSecond, error_));
}

TEST_F(CredentialsTest, VeryManySourcesWithWrongTokensLeaveOthersTheirs) {
  Credentials some(config_, kUser);
  constexpr int kSources = 5000;
  for (int i = 0; i < kSources; ++i)
    EXPECT_FALSE(some.check("0123456789abcdef-wrong", std::to_string(i), i, error_));
  EXPECT_TRUE(some.check(kOwner, "another", kSources, error_)) << error_;
  for (int i = 0; i < Credentials::kMostFailures; ++i)
    EXPECT_FALSE(some.check("0123456789abcdef-wrong", "another", kSources, error_));
  EXPECT_FALSE(some.check(kOwner, "another", kSources, error_)) << "it counts among many, too";
}

TEST_F(CredentialsTest, AllAddressesOfTheLoopbackAreOneSource) {
  EXPECT_EQ(sourceOf("127.8.9.10"), sourceOf("127.0.0.1"));
  EXPECT_NE(sourceOf("10.0.0.1"), sourceOf("10.0.0.2"));
  EXPECT_NE(sourceOf("12.7.0.1"), sourceOf("127.0.0.1"));
}

TEST_F(CredentialsTest, UsersOfTheSocketHaveTheirRoles) {
  config_.tokens.clear();
  config_.ownerUsers = {"5000"};
  config_.operatorUsers = {"5001"};
  const Credentials some(config_, kUser);
  EXPECT_EQ(some.identityOf(0x7f000001, 5000).role, ClientRole::owner);
  EXPECT_EQ(some.identityOf(0x7f000001, 5001).role, ClientRole::operating);
  EXPECT_EQ(some.identityOf(0x7f000001, 5002).role, ClientRole::observer);
  EXPECT_EQ(some.identityOf(0x7f000001, {}).role, ClientRole::observer);
  EXPECT_TRUE(some.hasOperators());
}

TEST_F(CredentialsTest, ClientsOfTrustedNetworksOwnWithoutATokenAndProveNothing) {
  config_.trustedNetworks = {"10.1.0.0/16"};
  const Credentials some(config_, kUser);
  EXPECT_EQ(some.identityOf(kLab, {}).role, ClientRole::owner);
  EXPECT_FALSE(some.identityOf(kLab, {}).proven);
  EXPECT_EQ(some.identityOf(kLab + 0x10000, {}).role, ClientRole::observer);
}

TEST_F(CredentialsTest, AFileThatOthersMayReadIsRefused) {
  fs::permissions(file_, fs::perms::group_read, fs::perm_options::add);
  EXPECT_NE(errorOf().find("chmod 0600"), std::string::npos) << errorOf();
  fs::remove(file_);
  fs::create_directory(file_);
  EXPECT_NE(errorOf().find("is a directory"), std::string::npos) << errorOf();
}

TEST_F(CredentialsTest, MalformedFilesAreRefusedWithoutTheirTokens) {
  for (const std::string text :
       {"", "owner", "owner short", "king 0123456789abcdef", "owner 0123456789abcdef secondsecondsecond",
        "owner 0123456789abcdef\nobserver 0123456789abcdef"}) {
    write(text);
    EXPECT_NE(errorOf(), "") << text;
    EXPECT_EQ(errorOf().find("0123456789abcdef"), std::string::npos);
  }
  write("owner " + std::string(129, 'x'));
  EXPECT_NE(errorOf(), "");
}

}  // namespace
}  // namespace hapticd::server
