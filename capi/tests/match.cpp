// Matches the frames of a video in C++ from several threads, with a shared matcher and with one per thread. The maps must be identical to
// those of the program.
//
//     match-cpp LEFT.pnm RIGHT.pnm MAX-DISPARITY MAP.pfm
#include "pnm.h"

#include <mrfgs.h>

#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

static_assert(sizeof(mrfgs_image) == 2 * sizeof(void *) + 16 || sizeof(void *) != 8, "no field moves");
static_assert(offsetof(mrfgs_maps, right) == 7 * sizeof(void *), "no field moves");
static_assert(sizeof(mrfgs_maps) == 11 * sizeof(void *), "no field moves");
static_assert(sizeof(mrfgs_view) == 6 * sizeof(void *), "no field moves");
static_assert(offsetof(mrfgs_prior, usual_sigma) == 7 * sizeof(void *), "no field moves");
static_assert(sizeof(mrfgs_prior_point) == 4 * sizeof(double), "no field moves");

namespace {

void checked(mrfgs_status status) {
    if (status != MRFGS_STATUS_OK) throw std::runtime_error(mrfgs_last_error());
}

struct Free {
    void operator()(mrfgs_options *options) const { mrfgs_options_free(options); }
    void operator()(mrfgs_matcher *matcher) const { mrfgs_matcher_free(matcher); }
};

using Matcher = std::unique_ptr<mrfgs_matcher, Free>;

Matcher matcher_of(const char *preset) {
    std::unique_ptr<mrfgs_options, Free> options(mrfgs_options_new());
    checked(mrfgs_options_preset(options.get(), preset));
    checked(mrfgs_options_device(options.get(), "cpu"));
    mrfgs_matcher *matcher = nullptr;
    checked(mrfgs_matcher_new(options.get(), &matcher));
    return Matcher(matcher);
}

mrfgs_image image_of(const pnm &frame) {
    const mrfgs_format format = frame.bytes == 4 ? MRFGS_FORMAT_GREY32F : frame.bytes == 2 ? MRFGS_FORMAT_GREY16 : frame.channels == 3 ? MRFGS_FORMAT_RGB8 : MRFGS_FORMAT_GREY8;
    return {frame.data, frame.width * frame.channels * frame.bytes, std::uint32_t(frame.width), std::uint32_t(frame.height), format};
}

bool found(mrfgs_matcher *matcher, const pnm &left, const pnm &right, mrfgs_range range, const pnm &expected) {
    // Rows at odd addresses.
    const std::size_t row = expected.width * sizeof(float), stride = row + 5;
    std::vector<std::uint8_t> map(stride * expected.height + 1);
    mrfgs_maps maps{};
    maps.size = sizeof maps;
    maps.disparity = reinterpret_cast<float *>(map.data() + 1);
    maps.disparity_stride = stride;
    const mrfgs_image views[] = {image_of(left), image_of(right)};
    // A prior that knows nothing changes nothing.
    const std::vector<float> unknown(expected.width * expected.height, std::numeric_limits<float>::quiet_NaN());
    mrfgs_prior prior{};
    prior.size = sizeof prior;
    prior.disparity = unknown.data();
    prior.disparity_stride = row;
    prior.kind = MRFGS_PRIOR_KIND_SURFACE;
    checked(mrfgs_match_prior(matcher, &views[0], &views[1], nullptr, nullptr, &range, nullptr, &prior, &maps));
    mrfgs_prior_use used{};
    checked(mrfgs_last_prior(&used));
    bool same = used.kind == MRFGS_PRIOR_KIND_SURFACE && used.given == 0;
    for (std::size_t y = 0; y < expected.height; y++)
        same &= std::memcmp(&map[1 + y * stride], expected.data + y * row, row) == 0;
    return same;
}

}  // namespace

int main(int argc, char **argv) try {
    if (argc != 5) return 2;
    const pnm left = pnm_read(argv[1]), right = pnm_read(argv[2]), expected = pnm_read(argv[4]);
    const mrfgs_range range{0, std::stoi(argv[3])};
    const Matcher shared = matcher_of("fast");
    std::vector<int> right_ones(3);
    std::vector<std::thread> threads;
    for (std::size_t i = 0; i < right_ones.size(); i++) {
        threads.emplace_back([&, i] {
            const Matcher own = i == 0 ? matcher_of("fast") : nullptr;
            mrfgs_matcher *matcher = own ? own.get() : shared.get();
            for (int frame = 0; frame < 2; frame++) right_ones[i] += found(matcher, left, right, range, expected);
            // Each thread has its own errors.
            if (mrfgs_matcher_new(nullptr, nullptr) != MRFGS_STATUS_ARGUMENT || !*mrfgs_last_error()) right_ones[i] = 0;
        });
    }
    for (auto &thread : threads) thread.join();
    if (right_ones != std::vector<int>{2, 2, 2}) throw std::runtime_error("the maps are not those of the program");
    if (*mrfgs_last_error()) throw std::runtime_error("an error of another thread");
    try {
        matcher_of("quick");
        throw std::logic_error("there is no such preset");
    } catch (const std::runtime_error &error) {
        if (std::string(error.what()).find("quick") == std::string::npos) throw;
    }
    for (const pnm *frame : {&left, &right, &expected}) std::free(frame->data);
    std::printf("match.cpp: %zu x %zu from 3 threads: all maps are equal\n", left.width, left.height);
} catch (const std::exception &error) {
    std::fprintf(stderr, "match.cpp: %s\n", error.what());
    return 1;
}
