#pragma once
// Elementary functions that give the same bits on every processor. libm chooses its code by
// processor, and its last bit with it; these are + - * /, sqrt, rounding to integers and bit
// patterns only. All are pure and never fail: NaN gives NaN. One ulp is the distance of doubles at
// the value; bounds are those of tests/unit/dem/elementary_test.cc, against libm in long double.

namespace calib::dem {

/// e^x within 1 ulp, gradually underflowing below -708; infinite above 709.79.
double Exp(double x);

/// e^x - 1 within 3 ulp, about zero too.
double Expm1(double x);

/// ln x within 1 ulp; -infinity at 0, NaN below.
double Log(double x);

/// ln(1 + x) within 3 ulp, about zero too; -infinity at -1, NaN below.
double Log1p(double x);

/// x^y of any two numbers, with the special values of C. Whole y of at most 64 in size: by
/// multiplication, within |y| ulp; else e^(y ln x) within 2 + 2 |y ln x| ulp.
double Pow(double x, double y);

/// The cube root within 1 ulp, of negative numbers too.
double CubeRoot(double x);

/// sin x and cos x (Cosine) within 1 ulp, tan x (Tangent) within 2 ulp, while |x| < 1e6 (next to
/// their zeros the error is below 1e-28 instead where that is more); beyond that the period is 2 pi
/// as a double, and from 1e15 on or so they say nothing. Infinite x gives NaN.
double Sine(double x);
double Cosine(double x);
double Tangent(double x);

/// tanh x within 3 ulp.
double HyperbolicTangent(double x);

/// arctan x within 2 ulp.
double Arctangent(double x);

/// Direction of (x, y) from the axis of x, anticlockwise, in [-pi, pi], within 3 ulp; 0 at the
/// origin.
double Direction(double y, double x);

/// The error function within 1e-15 for |x| <= 3; beyond it saturates at +-erf(3).
double ErrorFunction(double x);

/// sqrt(x^2 + y^2 + z^2) within 2 ulp where the squares neither overflow nor vanish.
double Hypotenuse(double x, double y, double z = 0);

}  // namespace calib::dem
