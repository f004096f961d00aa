/* A V4L2 camera without a kernel: preloaded into a process, it answers for one device file what a UVC driver would.
 *
 * DRIVER_DEVICE   the file that is the camera, for example /dev/video77
 * DRIVER_REFUSES  exposure | manual | size: what is not taken
 * DRIVER_BREAKS   number of the frame after which the device is gone, once
 * DRIVER_RETURNS  milliseconds after which it can be opened again; never if not given
 *
 * Frames are YUYV, 15 a second, of a wall that moves 3 px a frame to the left.  Stamps are monotonic, of the start of the
 * exposure, which is 20 ms before a buffer can be taken.  Who comes late on a busy machine gets every frame all the same.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

enum { BUFFERS = 8, STEP_PX = 3, AGE_US = 20000, PERIOD_US = 66667 };

static int device = -1, width = 640, height = 480, queued[BUFFERS], waiting, gone;
static long exposure = 157, automatic = 3, gain = 1, frame;
static int64_t gone_ms, due_us;
static unsigned char *buffers[BUFFERS];

static int refuses(const char *what) {
    const char *named = getenv("DRIVER_REFUSES");
    return named && !strcmp(named, what);
}

static int is_ours(const char *path) {
    const char *named = getenv("DRIVER_DEVICE");
    return named && path && !strcmp(path, named);
}

static int64_t now_us(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

static int64_t now_ms(void) { return now_us() / 1000; }

/* The file becomes readable when the next frame is there. */
static int arm(int64_t at_us) {
    struct itimerspec at = {{0, 0}, {at_us / 1000000, at_us % 1000000 * 1000}};
    due_us = at_us;
    return timerfd_settime(device, TFD_TIMER_ABSTIME, &at, NULL);
}

static int connect_camera(void) {
    const char *returns = getenv("DRIVER_RETURNS");
    if (gone_ms && (!returns || now_ms() - gone_ms < atol(returns))) return errno = ENOENT, -1;
    device = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK);
    gone = 0, exposure = 157, automatic = 3, gain = 1;
    return device;
}

/* Both names are in use, depending on how OpenCV was built. */
#define OPEN(name)                                          \
    int name(const char *path, int flags, ...) {            \
        static int (*real)(const char *, int, ...);         \
        if (!real) real = dlsym(RTLD_NEXT, #name);          \
        if (is_ours(path)) return connect_camera();         \
        va_list more;                                       \
        va_start(more, flags);                              \
        int mode = va_arg(more, int);                       \
        va_end(more);                                       \
        return real(path, flags, mode);                     \
    }

OPEN(open)
OPEN(open64)

int close(int file) {
    static int (*real)(int);
    if (!real) real = dlsym(RTLD_NEXT, "close");
    if (file >= 0 && file == device) device = -1;
    return real(file);
}

static size_t bytes(void) { return (size_t)width * height * 2; }

static void *buffer_at(off_t offset) { return buffers[offset / 4096]; }

void *mmap(void *where, size_t size, int rights, int flags, int file, off_t offset) {
    static void *(*real)(void *, size_t, int, int, int, off_t);
    if (!real) real = dlsym(RTLD_NEXT, "mmap");
    if (file >= 0 && file == device) {
        buffers[offset / 4096] = real(NULL, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        return buffer_at(offset);
    }
    return real(where, size, rights, flags, file, offset);
}

void *mmap64(void *where, size_t size, int rights, int flags, int file, off_t offset) {
    return mmap(where, size, rights, flags, file, offset);
}

static uint32_t grain(uint32_t x, uint32_t y) {
    uint32_t h = x * 374761393u + y * 668265263u;
    h = (h ^ (h >> 13)) * 1274126177u;
    return (h ^ (h >> 16)) & 63;
}

static void draw(unsigned char *out) {
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            uint32_t at = x + STEP_PX * frame, sum = 0;
            for (int k = 0; k < 4; k++) sum += grain((at + k) / 2, y / 3);
            out[2 * (y * width + x)] = 40 + sum / 2 + (grain(x + 977 * frame, y) & 3);
            out[2 * (y * width + x) + 1] = 128;
        }
}

static void set_format(struct v4l2_format *format) {
    struct v4l2_pix_format *p = &format->fmt.pix;
    if (!refuses("size") && p->width >= 160 && p->width <= 1920) width = p->width & ~1u, height = p->height;
    p->pixelformat = V4L2_PIX_FMT_YUYV;
    p->width = width, p->height = height, p->field = V4L2_FIELD_NONE;
    p->bytesperline = 2 * width, p->sizeimage = bytes(), p->colorspace = V4L2_COLORSPACE_SRGB;
}

static int control(unsigned long request, struct v4l2_control *c) {
    long *value = c->id == V4L2_CID_EXPOSURE_AUTO ? &automatic
                  : c->id == V4L2_CID_EXPOSURE_ABSOLUTE ? &exposure
                  : c->id == V4L2_CID_GAIN ? &gain : NULL;
    if (!value) return errno = EINVAL, -1;
    if (request == VIDIOC_G_CTRL) return c->value = *value, 0;
    if (c->id == V4L2_CID_EXPOSURE_AUTO && (refuses("manual") || (c->value != 1 && c->value != 3)))
        return errno = EINVAL, -1;
    if (c->id == V4L2_CID_EXPOSURE_ABSOLUTE && (automatic == 3 || refuses("exposure"))) return errno = EACCES, -1;
    *value = c->value;
    return 0;
}

static int take_buffer(struct v4l2_buffer *b) {
    uint64_t fired;
    const char *breaks = getenv("DRIVER_BREAKS");
    if (breaks && !gone_ms && frame >= atol(breaks)) gone_ms = now_ms(), gone = 1;
    if (gone) return errno = ENODEV, -1;
    if (!waiting || read(device, &fired, sizeof fired) != sizeof fired) return errno = EAGAIN, -1;
    int64_t us = due_us - AGE_US;
    arm(due_us + PERIOD_US);
    frame++;
    int index = queued[0];
    memmove(queued, queued + 1, sizeof(int) * --waiting);
    draw(buffers[index]);
    b->index = index, b->length = b->bytesused = bytes(), b->m.offset = 4096 * index, b->sequence = frame, b->field = V4L2_FIELD_NONE;
    b->timestamp.tv_sec = us / 1000000, b->timestamp.tv_usec = us % 1000000;
    b->flags = V4L2_BUF_FLAG_MAPPED | V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
    return 0;
}

static int stream(int on) {
    if (!on) waiting = 0;
    return arm(on ? now_us() + PERIOD_US : 0);
}

static int answer(unsigned long request, void *given) {
    switch (request) {
    case VIDIOC_QUERYCAP: {
        struct v4l2_capability *c = given;
        memset(c, 0, sizeof *c);
        strcpy((char *)c->driver, "uvcvideo");
        strcpy((char *)c->card, "made-up camera");
        c->capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING | V4L2_CAP_DEVICE_CAPS;
        c->device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
        return 0;
    }
    case VIDIOC_G_INPUT: return *(int *)given = 0, 0;
    case VIDIOC_S_INPUT: return 0;
    case VIDIOC_ENUMINPUT: {
        struct v4l2_input *input = given;
        if (input->index) return errno = EINVAL, -1;
        input->type = V4L2_INPUT_TYPE_CAMERA;
        return 0;
    }
    case VIDIOC_ENUM_FMT: {
        struct v4l2_fmtdesc *f = given;
        if (f->index) return errno = EINVAL, -1;
        f->pixelformat = V4L2_PIX_FMT_YUYV;
        return 0;
    }
    case VIDIOC_G_FMT: case VIDIOC_S_FMT: case VIDIOC_TRY_FMT: {
        struct v4l2_format *f = given;
        if (f->type != V4L2_BUF_TYPE_VIDEO_CAPTURE) return errno = EINVAL, -1;
        if (request != VIDIOC_G_FMT && f->fmt.pix.pixelformat != V4L2_PIX_FMT_YUYV) return errno = EINVAL, -1;
        return set_format(f), 0;
    }
    case VIDIOC_G_PARM: case VIDIOC_S_PARM: {
        struct v4l2_streamparm *p = given;
        p->parm.capture.capability = V4L2_CAP_TIMEPERFRAME;
        p->parm.capture.timeperframe = (struct v4l2_fract){1, 15};
        return 0;
    }
    case VIDIOC_QUERYCTRL: {
        struct v4l2_queryctrl *q = given;
        if (q->id == V4L2_CID_EXPOSURE_ABSOLUTE) return q->minimum = 3, q->maximum = 2500, q->step = 1, q->flags = 0, 0;
        if (q->id == V4L2_CID_EXPOSURE_AUTO) return q->minimum = 0, q->maximum = 3, q->step = 1, q->flags = 0, 0;
        if (q->id == V4L2_CID_GAIN) return q->minimum = 0, q->maximum = 100, q->step = 1, q->flags = 0, 0;
        return errno = EINVAL, -1;
    }
    case VIDIOC_G_CTRL: case VIDIOC_S_CTRL: return control(request, given);
    case VIDIOC_REQBUFS: {
        struct v4l2_requestbuffers *r = given;
        if (r->count > BUFFERS) r->count = BUFFERS;
        return 0;
    }
    case VIDIOC_QUERYBUF: {
        struct v4l2_buffer *b = given;
        b->length = bytes(), b->m.offset = 4096 * b->index;
        return 0;
    }
    case VIDIOC_QBUF: {
        struct v4l2_buffer *b = given;
        if (waiting < BUFFERS) queued[waiting++] = b->index;
        return 0;
    }
    case VIDIOC_DQBUF: return take_buffer(given);
    case VIDIOC_STREAMON: return stream(1);
    case VIDIOC_STREAMOFF: return stream(0);
    }
    return errno = ENOTTY, -1;
}

int ioctl(int file, unsigned long request, ...) {
    static int (*real)(int, unsigned long, ...);
    if (!real) real = dlsym(RTLD_NEXT, "ioctl");
    va_list more;
    va_start(more, request);
    void *given = va_arg(more, void *);
    va_end(more);
    return file >= 0 && file == device ? answer(request & 0xFFFFFFFFu, given) : real(file, request, given);
}
