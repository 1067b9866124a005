// Replaces cv::StereoSGBM in a program that uses OpenCV: views in, disparities out, like its compute().
//
//     c++ sgbm.cpp $(pkg-config --cflags --libs mrfgs opencv4) && ./a.out left.png right.png 64 disparity.png
#include <mrfgs.h>
#include <opencv2/imgcodecs.hpp>

#include <cstdlib>
#include <iostream>

// Instead of cv::StereoSGBM::create(0, labels)->compute(left, right, disparity). Disparities are floats in pixels, +infinity where
// missing; those of SGBM are 16-bit integers in 1/16 px.
static void compute(mrfgs_matcher *matcher, const cv::Mat &left, const cv::Mat &right, int labels, cv::Mat &disparity) {
    const cv::Mat *views[] = {&left, &right};
    mrfgs_image images[2];
    for (int i = 0; i < 2; i++)
        images[i] = {views[i]->data, views[i]->step, std::uint32_t(views[i]->cols), std::uint32_t(views[i]->rows), MRFGS_FORMAT_BGR8};
    disparity.create(left.size(), CV_32F);
    mrfgs_maps maps{sizeof maps, disparity.ptr<float>(), disparity.step, nullptr, 0, nullptr, 0, nullptr, 0};
    const mrfgs_range range{0, labels - 1};
    if (mrfgs_match(matcher, &images[0], &images[1], &range, &maps) != MRFGS_STATUS_OK) CV_Error(cv::Error::StsError, mrfgs_last_error());
}

int main(int argc, char **argv) {
    if (argc != 5) return 2;
    mrfgs_matcher *matcher = nullptr;  // Instead of the cv::Ptr<cv::StereoSGBM>: keep it from frame to frame.
    if (mrfgs_matcher_new(nullptr, &matcher) != MRFGS_STATUS_OK) return std::cerr << mrfgs_last_error() << '\n', 1;
    const cv::Mat left = cv::imread(argv[1]), right = cv::imread(argv[2]);
    cv::Mat disparity, levels;
    compute(matcher, left, right, std::atoi(argv[3]), disparity);
    disparity.convertTo(levels, CV_16U, 256);  // The encoding of KITTI.
    mrfgs_matcher_free(matcher);
    return cv::imwrite(argv[4], levels) ? 0 : 1;
}
