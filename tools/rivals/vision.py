"""Feature matchers and ECC of OpenCV beside `cfpose register`, on the same exported pairs.

By hand, in an environment outside the project:

    pip install "opencv-python-headless<5" numpy    # version 5 has no BRISK and AKAZE
    cfpose cells clean25 hard cut20 greys20 --trials 20 --seed 20 --export pairs
    python tools/rivals/vision.py pairs --cfpose target/release/cfpose

Every method gets the two images of a pair and returns a homography (reference to frame, pixels). A row tells for how many pairs the mean
error over the test places is below 1 and .1 pixels, its median, and the CPU time of a pair (one thread).
cfpose gets the camera of the pairs and the model of a pose; the others estimate a homography, as their interfaces do.
"""

import argparse
import json
import pathlib
import resource
import subprocess
import time

import cv2
import numpy as np

DETECTORS = {
    "SIFT": lambda: cv2.SIFT_create(),
    "ORB": lambda: cv2.ORB_create(2000),
    "BRISK": lambda: (getattr(cv2, "BRISK_create", None) or cv2.xfeatures2d.BRISK_create)(),
    "AKAZE": lambda: (getattr(cv2, "AKAZE_create", None) or cv2.xfeatures2d.AKAZE_create)(),
}
# Of two nearest descriptors the first has to be this much nearer (Lowe's ratio test); RANSAC's threshold, pixels.
RATIO, THRESHOLD = 0.8, 2.0
CRITERIA = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 200, 1e-7)


def by_features(make):
    detector = make()
    norm = cv2.NORM_L2 if detector.defaultNorm() == cv2.NORM_L2 else cv2.NORM_HAMMING

    def register(reference, frame):
        places, descriptors = zip(*(detector.detectAndCompute(image, None) for image in (reference, frame)))
        if any(d is None or len(d) < 4 for d in descriptors):
            return None
        pairs = cv2.BFMatcher(norm).knnMatch(descriptors[0], descriptors[1], k=2)
        kept = [pair[0] for pair in pairs if len(pair) == 2 and pair[0].distance < RATIO * pair[1].distance]
        if len(kept) < 4:
            return None
        source = np.float32([places[0][m.queryIdx].pt for m in kept])
        target = np.float32([places[1][m.trainIdx].pt for m in kept])
        return cv2.findHomography(source, target, cv2.RANSAC, THRESHOLD)[0]

    return register


def by_ecc(levels):
    def register(reference, frame):
        found = np.eye(3, dtype=np.float32)
        for level in reversed(range(levels)):
            scale = 0.5**level
            small = [cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) for image in (reference, frame)]
            to_small = np.diag([scale, scale, 1.0])
            begin = (to_small @ found @ np.linalg.inv(to_small)).astype(np.float32)
            try:
                _, fitted = cv2.findTransformECC(small[0], small[1], begin, cv2.MOTION_HOMOGRAPHY, CRITERIA, None, 5)
            except cv2.error:
                return None
            found = np.linalg.inv(to_small) @ fitted.astype(np.float64) @ to_small
        return found

    return register


def by_cfpose(binary, folder, truth):
    camera = ",".join(str(v) for v in truth["camera"])
    files = [str(folder / f"{truth['name']}_{part}.png") for part in ("reference", "frame")]
    run = [binary, "register", *files, "--camera", camera, "--transfer", truth["transfer"], "--json", "-"]
    out = subprocess.run(run, capture_output=True, text=True, check=False).stdout
    found = json.loads(out.splitlines()[0])["homography"] if out.strip() else None
    return None if found is None else np.array(found)


def error(found, truth):
    if found is None:
        return np.inf
    places = np.array(truth["test_points_px"])
    homogeneous = np.column_stack([places, np.ones(len(places))])
    mapped = [homogeneous @ np.asarray(h, dtype=float).T for h in (found, truth["homography"])]
    with np.errstate(all="ignore"):
        a, b = (m[:, :2] / m[:, 2:] for m in mapped)
    mean = float(np.mean(np.linalg.norm(a - b, axis=1)))
    return mean if np.isfinite(mean) else np.inf


def cpu(children):
    usage = resource.getrusage(resource.RUSAGE_CHILDREN if children else resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("pairs", type=pathlib.Path, help="folder that `cfpose cells --export` wrote")
    parser.add_argument("--cfpose", help="the program, to add its row")
    args = parser.parse_args()
    cv2.setNumThreads(1)
    truths = json.loads((args.pairs / "truth.json").read_text())
    methods = {}
    for name, make in DETECTORS.items():
        try:
            methods[f"{name} + RANSAC"] = by_features(make)
        except AttributeError:
            print(f"note: this OpenCV has no {name}")
    methods |= {"ECC, one level": by_ecc(1), "ECC, four levels": by_ecc(4)}
    print(f"OpenCV {cv2.__version__}\n\n| cell | method | pairs | < .1 px % | < 1 px % | median px | CPU ms |\n|---|---|---|---|---|---|---|")
    for cell in dict.fromkeys(truth["cell"] for truth in truths):
        chosen = [truth for truth in truths if truth["cell"] == cell]
        for name, register in [*methods.items(), *([("cfpose register", None)] if args.cfpose else [])]:
            errors, begun = [], cpu(register is None)
            for truth in chosen:
                if register is None:
                    errors.append(error(by_cfpose(args.cfpose, args.pairs, truth), truth))
                    continue
                images = [cv2.imread(str(args.pairs / f"{truth['name']}_{part}.png"), cv2.IMREAD_GRAYSCALE) for part in ("reference", "frame")]
                errors.append(error(register(*images), truth))
            spent = 1e3 * (cpu(register is None) - begun) / len(chosen)
            share = [100 * np.mean([e < limit for e in errors]) for limit in (0.1, 1.0)]
            median = np.median(errors)
            shown = f"{median:.3f}" if np.isfinite(median) else "none"
            print(f"| {cell} | {name} | {len(chosen)} | {share[0]:.0f} | {share[1]:.0f} | {shown} | {spent:.0f} |", flush=True)


if __name__ == "__main__":
    started = time.time()
    main()
    print(f"\n{time.time() - started:.0f} s")
