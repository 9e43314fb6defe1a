#include "core/sha256.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <openssl/evp.h>

#include "core/error.h"

namespace ambilux {
namespace {

void require(int done) {
    if (done != 1) throw Error(ExitCode::device, "libcrypto cannot make a SHA-256 digest");
}

}  // namespace

void Sha256::Free::operator()(evp_md_ctx_st* context) const { EVP_MD_CTX_free(context); }

Sha256::Sha256() : context_(EVP_MD_CTX_new()) { require(EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr)); }

void Sha256::update(const void* data, size_t size) { require(EVP_DigestUpdate(context_.get(), data, size)); }

Sha256Digest Sha256::digest() {
    Sha256Digest out;
    require(EVP_DigestFinal_ex(context_.get(), out.data(), nullptr));
    return out;
}

Sha256Digest sha256(std::string_view bytes) {
    Sha256 hash;
    hash.update(bytes);
    return hash.digest();
}

std::string to_hex(const Sha256Digest& digest) { return fmt::format("{:02x}", fmt::join(digest, "")); }

}  // namespace ambilux
