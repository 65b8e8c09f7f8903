// How alike two pictures of a scene are. Runs in a browser, which decodes the pictures; so it stands for itself alone.

/**
 * Pictures as PNG in base64, by two programs: `whole`, and of the same things before a `black` and a `white` background. A pixel is in the
 * silhouette if things cover at least 3/8 of it: as many of sixteen samples as of four, where that is from two on. How bright they are does
 * not count. Gives `iou`, the share of both
 * silhouettes together that lies in both (1 where neither has any); `near`, the share of both silhouettes' pixels that lie in the
 * other one or beside one of its pixels, which is fair to lines a pixel wide; `ssim`, the mean structural similarity of luminance (Wang
 * et al. 2004: Gaussian windows of 11 pixels, sigma 1.5); `difference`, the mean of colours, of 255.
 */
export async function measure({a: one, b: other}) {
  async function pixels(base64) {
    const image = new Image();
    image.src = `data:image/png;base64,${base64}`;
    await image.decode();
    const canvas = document.createElement('canvas');
    canvas.width = image.width, canvas.height = image.height;
    const context = canvas.getContext('2d');
    context.fillRect(0, 0, image.width, image.height);  // clear is black
    context.drawImage(image, 0, 0);
    return {width: image.width, height: image.height, data: context.getImageData(0, 0, image.width, image.height).data};
  }
  const through = (black, white, i) => Math.max(...[0, 1, 2].map((c) => white.data[4 * i + c] - black.data[4 * i + c])) / 255;
  const [a, aBlack, aWhite, b, bBlack, bWhite] =
    await Promise.all([one.whole, one.black, one.white, other.whole, other.black, other.white].map(pixels));
  if (a.width !== b.width || a.height !== b.height) throw new Error('the pictures have different sizes');
  const count = a.width * a.height;
  const covered = (black, white) => Uint8Array.from({length: count}, (_, i) => through(black, white, i) <= 5 / 8);
  const inA = covered(aBlack, aWhite), inB = covered(bBlack, bWhite);
  /** Whether the pixel or one of its eight neighbours is set. */
  function beside(mask, i) {
    const x = i % a.width, y = Math.floor(i / a.width);
    for (let v = Math.max(y - 1, 0); v <= Math.min(y + 1, a.height - 1); ++v)
      for (let u = Math.max(x - 1, 0); u <= Math.min(x + 1, a.width - 1); ++u)
        if (mask[v * a.width + u]) return true;
    return false;
  }
  let both = 0, either = 0, each = 0, close = 0, difference = 0;
  for (let i = 0; i < count; ++i) {
    both += inA[i] && inB[i], either += inA[i] || inB[i], each += inA[i] + inB[i];
    close += (inA[i] && beside(inB, i)) + (inB[i] && beside(inA, i));
    for (let c = 0; c < 3; ++c) difference += Math.abs(a.data[4 * i + c] - b.data[4 * i + c]) / (3 * count);
  }

  const luminance = (p) => Float64Array.from({length: count}, (_, i) => .299 * p.data[4 * i] + .587 * p.data[4 * i + 1] + .114 * p.data[4 * i + 2]);
  const kernel = Array.from({length: 11}, (_, i) => Math.exp(-((i - 5) ** 2) / (2 * 1.5 ** 2)));
  const sum = kernel.reduce((x, y) => x + y);
  /** Smoothed along both axes; beyond the picture its edge goes on. */
  function smoothed(values) {
    let now = values;
    for (const step of [1, a.width]) {
      const [length, limit] = step === 1 ? [a.width, (i) => i % a.width] : [a.height, (i) => Math.floor(i / a.width)];
      const next = new Float64Array(count);
      for (let i = 0; i < count; ++i) {
        const at = limit(i);
        for (let k = 0; k < 11; ++k) next[i] += kernel[k] / sum * now[i + (Math.min(Math.max(at + k - 5, 0), length - 1) - at) * step];
      }
      now = next;
    }
    return now;
  }
  const x = luminance(a), y = luminance(b);
  const mx = smoothed(x), my = smoothed(y);
  const xx = smoothed(x.map((v) => v * v)), yy = smoothed(y.map((v) => v * v)), xy = smoothed(x.map((v, i) => v * y[i]));
  const c1 = (.01 * 255) ** 2, c2 = (.03 * 255) ** 2;
  let ssim = 0;
  for (let i = 0; i < count; ++i) {
    const vx = xx[i] - mx[i] ** 2, vy = yy[i] - my[i] ** 2, vxy = xy[i] - mx[i] * my[i];
    ssim += (2 * mx[i] * my[i] + c1) * (2 * vxy + c2) / ((mx[i] ** 2 + my[i] ** 2 + c1) * (vx + vy + c2)) / count;
  }
  return {iou: either ? both / either : 1, near: each ? close / each : 1, ssim, difference};
}
