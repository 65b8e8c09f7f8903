// A library of others for which there are stubs, and no module.
extern "C" double rtsg_absent_sum(int a, double b);
extern "C" double rtsg_absent_sum(int a, double b) {
    return a + b;
}
